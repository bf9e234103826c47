"""Pictures, tables, pages and recordings of results."""
