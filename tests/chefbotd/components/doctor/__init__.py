"""What the doctor concludes, from measurements made by hand."""
