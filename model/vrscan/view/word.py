"""The word that the terminal prints, without which a page of a board only shows."""

import hmac
import secrets

LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"  # none that looks like another one
GROUPS, GROUP = 2, 5  # 50 bits: nobody guesses that


def new_word() -> str:
    """Return a word that nobody had before."""
    return "-".join("".join(map(secrets.choice, [LETTERS] * GROUP)) for _ in range(GROUPS))


def is_word(typed: str, word: str) -> bool:
    """Return whether somebody typed the word; case, blanks and hyphens do not count."""
    return hmac.compare_digest(_bare(typed), _bare(word))


def _bare(text: str) -> bytes:
    return "".join(text.lower().replace("-", "").split()).encode()
