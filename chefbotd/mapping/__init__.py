"""Maps: made of scans and odometry, kept, and read again. Pure: values in, values out, a seed for what is random."""
