"""Write the pages of the ledger again from the committed results, without running a test: ``python -m tests.ledger``.

``python -m tests.ledger --tests`` prints the tests outside tests/physics and tests/peers that are evidence.
"""

import sys

from tests.ledger.capabilities import LedgerError, load_capabilities, outside_tests
from tests.ledger.pages import summary, write_pages
from tests.ledger.results import COMMITTED, load_results


def main(arguments):
    try:
        capabilities = load_capabilities()
    except LedgerError as error:
        print(error, file=sys.stderr)
        return 2
    if arguments == ["--tests"]:
        print(*outside_tests(capabilities))
    elif arguments:
        print("usage: python -m tests.ledger [--tests]", file=sys.stderr)
        return 2
    else:
        print(*summary(write_pages(COMMITTED.parent, capabilities, load_results())), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
