"""Where contours start and what they meet: starts that must move, and rivals that grow towards them."""
