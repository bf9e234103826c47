"""The experiment: models, flights, truth and comparison."""
