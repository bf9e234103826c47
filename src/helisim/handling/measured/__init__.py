"""A closed loop's responses from flight records alone, with their uncertainty."""
