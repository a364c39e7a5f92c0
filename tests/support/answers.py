"""What a process apart may do when it is asked, in a module that it can import."""

import os
import subprocess
import sys
import time

from semgrid_eval.apart import Channel


def serve(descriptor):
    channel = Channel(descriptor)
    while True:
        try:
            what, value = channel.question()
        except EOFError:
            return
        channel.say({"answer": globals()[what](channel, value)}, value if isinstance(value, bytes) else b"")


def echo(channel, value):
    return len(value) if isinstance(value, bytes) else value


def leave(channel, value):
    os._exit(value)


def wait(channel, value):
    channel.say({"progress": value})
    time.sleep(3600)


def start_another(channel, value):
    """Start a process that outlives this one and holds its end of the connection."""
    waiting = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"], close_fds=False)
    value.write_text(str(waiting.pid))
    os._exit(5)


def swell(channel, value):
    try:
        return len(bytearray(value))
    except MemoryError:
        return "no room"


def break_off(channel, value):
    os.write(channel._socket.fileno(), b"\xff" * 64)
