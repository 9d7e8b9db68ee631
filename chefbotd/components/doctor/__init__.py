"""The conclusions of the doctor: measurements in, findings out, without I/O and clock."""
