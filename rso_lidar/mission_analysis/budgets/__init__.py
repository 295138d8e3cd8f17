"""Link budgets in closed form: detection range and ranging precision."""
