"""Access to the page: only browsers that opened the address of this run, token included."""

import hmac
import re
from collections.abc import Iterator
from contextlib import closing, contextmanager
from http.client import FORBIDDEN, OK, HTTPConnection
from typing import Any

from catenary.errors import CatenaryError

OWN_HOST = re.compile(r"(127\.0\.0\.1|localhost)(:[0-9]{1,5})?")  # any port: behind ssh -L it is another one
REFUSED = "Refused: open the whole address that this run printed, at 127.0.0.1 or localhost, and from no other page.\n"
HEADERS = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Frame-Options": "DENY"}


@contextmanager
def gated(token: str) -> Iterator[None]:
    """Have servers that websockets opens meanwhile serve and accept only what asks for /TOKEN/ of their own address.

    A browser says in Host under which name it knows the address, in Origin which page asks; a program sends no Origin.
    viser has no hook for it: `websockets.asyncio.server.serve` is replaced.
    """
    from websockets.asyncio import server

    serve = server.serve

    def with_gate(*args: Any, process_request: Any = None, **options: Any) -> Any:
        def admit(connection: Any, request: Any) -> Any:
            hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
            first, _, below = request.path.partition("?")[0].removeprefix("/").partition("/")
            knows = hmac.compare_digest(first.encode(errors="surrogateescape"), token.encode())
            own = [f"http://{host}" for host in hosts if OWN_HOST.fullmatch(host)]
            if knows and len(hosts) == len(own) == 1 and origins in ([], own):
                request.path = f"/{below}"
                answer = process_request(connection, request)
            else:
                answer = connection.respond(FORBIDDEN, REFUSED)
            if answer is not None:
                answer.headers.update(HEADERS)
            return answer

        return serve(*args, process_request=admit, **options)

    server.serve = with_gate  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        server.serve = serve  # type: ignore[misc]


def require_gate(host: str, port: int, token: str) -> None:
    """Raise CatenaryError where a server lets in what has no token, as a later viser's may, or nothing with it."""
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket"}
    for path, headers, expected in (("/", {}, FORBIDDEN), ("/", upgrade, FORBIDDEN), (f"/{token}/", {}, OK)):
        with closing(HTTPConnection(host, port, timeout=30.0)) as connection:
            connection.request("GET", path, headers=headers)
            if (status := connection.getresponse().status) != expected:
                raise CatenaryError(
                    f"this viser would let in strangers ({status}, expected {expected:d}): pip install 'viser<1.2'"
                )
