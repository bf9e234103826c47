"""Value objects become things that people look at; nothing is computed here."""
