"""The report of a validation: JSON, an HTML page, a Markdown summary, and maps as evidence."""
