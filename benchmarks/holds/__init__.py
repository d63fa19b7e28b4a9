"""How well the hand is held: many sessions, their floors, and one table against the bars. See docs/evaluation.md."""
