"""What mends a finding, as the command line would say it."""

from shlex import quote


def said(finding):
    """Return a finding's remedy, such as "--repair gaps"."""
    words = [f"--{one.name.replace('_', '-')} {quote(one.value)}" for one in finding.remedy]
    return " ".join(words).strip()
