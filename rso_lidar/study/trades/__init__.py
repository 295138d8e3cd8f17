"""Trade studies: variants of a scenario compared by figures of merit."""
