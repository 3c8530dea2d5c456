"""What is wrong with a polynomial."""


class PolynomialError(ValueError):
    """One line: `what is wrong; what would be right`. `part` is the index of the monomial that it is about, if any."""

    def __init__(self, text: str, part: int | None = None):
        super().__init__(text)
        self.part = part
