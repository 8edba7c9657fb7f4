"""A scene: a body with the terms and supports picked for it."""
