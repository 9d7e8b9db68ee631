"""The probes of the doctor, on simulated robots that are not as they are believed to be."""
