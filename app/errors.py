"""The root of everything the application refuses to do."""


class AppError(Exception):
    """Something the application cannot or will not do.

    The message is one sentence or two for the experimenter: what was expected, what came, what to do. The
    command line prints it without a traceback; participants never see it.
    """
