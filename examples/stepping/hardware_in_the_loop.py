"""Run the vehicle in real time, with its controller outside: packets of UDP go there and back.

    python examples/stepping/hardware_in_the_loop.py

The controller runs in a thread here; for one on another computer, or on a board, only the address
changes. Packets hold doubles: fifteen measured and desired values there, three commands back. An
empty packet ends the controller.
"""

from socket import AF_INET, SOCK_DGRAM, socket
from threading import Thread
from time import perf_counter, sleep

import numpy as np

from auv_fmu import Simulation, simulate

#: Groups of the controller's inputs, of three numbers each.
INPUTS = ("y", "eta", "y_d", "dy_d", "ddy_d")


def controller(law, here):
    """Answer packets that arrive at a socket."""
    while True:
        packet, sender = here.recvfrom(1024)
        if not packet:
            return
        for name, values in zip(INPUTS, np.frombuffer(packet).reshape(5, 3)):
            law[f"controller.{name}"] = values
        here.sendto(law["controller.tau"].tobytes(), sender)
        law.step()


def vehicle(there, stop_time):
    """Return the result, and the longest round trip and delay of a step [s]."""
    auv = Simulation({"components": {"controller": False}})
    trips, delays = [], []
    with socket(AF_INET, SOCK_DGRAM) as here:
        here.settimeout(5.0)
        start = perf_counter()
        while auv.time < stop_time - 1e-9:
            sent = perf_counter()
            measured = auv["plant.y"], auv["plant.eta"][3:]
            desired = auv["planner.y_d"], auv["planner.dy_d"], auv["planner.ddy_d"]
            here.sendto(np.concatenate(measured + desired).tobytes(), there)
            auv["plant.tau"] = np.frombuffer(here.recv(1024))
            trips.append(perf_counter() - sent)
            auv.step()
            sleep(max(start + auv.time - perf_counter(), 0.0))
            delays.append(perf_counter() - start - auv.time)
        here.sendto(b"", there)
    return auv.result(), max(trips), max(delays)


if __name__ == "__main__":
    with socket(AF_INET, SOCK_DGRAM) as board:
        board.bind(("127.0.0.1", 0))
        law = Simulation({"only": ["controller"]}, keep=False)
        thread = Thread(target=controller, args=(law, board), daemon=True)
        thread.start()
        result, trip, delay = vehicle(board.getsockname(), 2.0)
        thread.join()
    print(f"longest round trip {1e3 * trip:.1f} ms, longest delay {1e3 * delay:.1f} ms")
    lockstep = simulate("fig4", stop_time=2.0)
    names = [f"plant.eta.{name}" for name in ("x", "y", "z", "phi", "theta", "psi")]
    away = max(np.abs(result[name] - lockstep[name]).max() for name in names)
    print(f"largest difference from simulate: {away}")
