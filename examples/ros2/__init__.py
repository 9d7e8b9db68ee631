"""RViz's buttons drive the simulated robot."""
