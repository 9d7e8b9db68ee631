"""``chefbotctl serve``: a simulated ChefBot that serves three tables."""
