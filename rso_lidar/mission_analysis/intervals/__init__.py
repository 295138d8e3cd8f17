"""Intervals in which conditions on two objects hold, over days: search, table, calendar, picture and scenarios."""
