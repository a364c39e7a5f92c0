"""Formats in which a table is written to a file, one module each; the page's is a macro of its template."""
