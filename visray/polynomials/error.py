"""The error for a polynomial that cannot be used."""


class PolynomialError(ValueError):
    """An error in a polynomial. Its text is one line: `what is wrong; what would be right`.

    part: index of the monomial with the error, or None.
    """

    def __init__(self, text: str, part: int | None = None):
        super().__init__(text)
        self.part = part
