"""The experiment: which models are identified from which flights, and what is true of them."""
