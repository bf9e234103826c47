"""From flight records to frequency responses, with the errors that they have."""
