"""What ends a program of this room with one line and exit status 2."""


class UserError(Exception):
    """The program cannot start or go on, for a reason that its user can fix."""
