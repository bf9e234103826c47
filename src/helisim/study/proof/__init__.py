"""The flown proof of a control law: what is specified, predicted, exact, and flown."""
