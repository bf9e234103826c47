"""From frequency responses to fitted models: search, errors, verdicts, what to doubt."""
