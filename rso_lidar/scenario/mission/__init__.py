"""The tables joined: files found, surfaces built, and the record of what was flown."""
