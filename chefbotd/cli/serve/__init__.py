"""``chefbotctl serve``: a simulated ChefBot that carries an order to three tables."""
