"""Fitted models against flights that no fit has seen."""
