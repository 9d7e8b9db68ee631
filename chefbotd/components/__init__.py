"""One folder for each capability, with all that is its own. Nothing in the driving core needs one of them."""
