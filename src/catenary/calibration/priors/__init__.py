"""What a fit knows beforehand: how much each class of features weighs, learnt on simulated robots."""
