"""What chefbotd costs and how fast it answers: ``python -m benchmarks [NAME ...] [--quick]``."""
