"""Model structures as data, and with numbers: matrices, responses, exact derivatives."""
