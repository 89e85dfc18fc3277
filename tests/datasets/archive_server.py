"""A local HTTP server whose connections break off, and which tells what it was asked for."""

import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@contextmanager
def serve(files, break_after=(), ranges=True):
    """Serve files (path to content). The n-th answer breaks off after break_after[n] bytes; the others are whole.

    None in break_after is an error of the server, 503.

    Yields the address and the list of requests: (path, Range header or None).
    """
    requests, breaks = [], list(break_after)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            asked = self.headers.get("Range")
            requests.append((self.path, asked))
            if breaks and breaks[0] is None:
                breaks.pop(0)  # first: the client asks again as soon as it has the answer
                self.send_error(503)
                return
            content = files.get(self.path)
            if content is None:
                self.send_error(404)
                return
            start = int(asked.removeprefix("bytes=").removesuffix("-")) if asked and ranges else 0
            if start and start >= len(content):
                self.send_error(416)
                return
            end = breaks.pop(0) if breaks else None
            self.send_response(206 if start else 200)
            if start:
                self.send_header("Content-Range", f"bytes {start}-{len(content) - 1}/{len(content)}")
            self.send_header("Content-Length", str(len(content) - start))
            self.end_headers()
            self.wfile.write(content[start:][:end])

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}", requests
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
