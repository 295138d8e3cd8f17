"""Plans flown by real forces: integrated legs, imperfect burns, and guidance that corrects them on the way."""
