"""The error class for polynomials that cannot be used."""


class PolynomialError(ValueError):
    """An error in a polynomial. Its text is one line: `what is wrong; what would be right`.

    part: index of the monomial that has the error; None if the error does not belong to one monomial of a list.
    """

    def __init__(self, text: str, part: int | None = None):
        super().__init__(text)
        self.part = part
