"""Flight records: named channels with units and provenance, on disk and from anyone's logs."""
