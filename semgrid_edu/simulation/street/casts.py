"""Who takes part in the test streets: convoys, pedestrians, people and cars that set off, crossing and overturned cars.

Each function puts its road users on the street of the `Traffic` that it is given.
"""

import numpy as np

from semgrid_edu.simulation.street.road_users import fill_street, park_cars
from semgrid_edu.simulation.street.traffic import Traffic
from semgrid_edu.simulation.street.trajectories import STAND, Departure, Pace, Trajectory
from semgrid_edu.simulation.things.cars import car_size
from semgrid_edu.simulation.things.materials import Kind


def convoys(traffic: Traffic) -> None:
    """Let two or three cars come one behind the other, and two overtake in the left one of our lanes.

    The gaps are 8 to 20 m, so that the first car hides the next one at first. Parameters are those of `park_cars`.
    """
    park_cars(traffic)
    road, rng, ego = traffic.road, traffic.rng, traffic.ego
    oncoming = Pace(rng.uniform(8, 14))
    meets = rng.uniform(0.6, 1.1) * traffic.duration
    first = ego.at(meets)[0] + oncoming.distance(meets)
    _convoy(traffic, first, 0.5 * road.lane, -1, oncoming, int(rng.integers(2, 4)))
    overtaking = Pace(ego.pace.mean + rng.uniform(2, 5))
    ahead = ego.at(traffic.duration)[0] + rng.uniform(20, 35) - overtaking.distance(traffic.duration)
    _convoy(traffic, ahead, -0.5 * road.lane, 1, overtaking, 2)


def _convoy(traffic: Traffic, s: float, d: float, along: int, pace: Pace, cars: int) -> None:
    """Let cars drive one behind the other, the first of them from s on."""
    for _ in range(cars):
        look = (traffic.body(), traffic.paint())
        traffic.drive_car(s, d, along, 0, pace, look)
        s -= along * (car_size(look[0])[0] + traffic.rng.uniform(8, 20))


def pedestrians(traffic: Traffic) -> None:
    """Let people walk along both sidewalks, and across the road. Parameters are those of `park_cars`."""
    park_cars(traffic)
    road, rng = traffic.road, traffic.rng
    middle = traffic.ego.at(traffic.duration / 2)[0]
    for sign, side in ((1, road.left), (-1, road.right)):
        for s in np.arange(middle + 2, middle + 55, 5.0):
            d = sign * (side.edge + side.strip + rng.uniform(0.4, max(side.walk - 0.4, 0.5)))
            traffic.walk(s + rng.uniform(0, 4), d, int(rng.choice([-1, 1])), 0, _walking(rng))
    for s in np.arange(middle + 8, middle + 50, 8.0):
        across, pace = int(rng.choice([-1, 1])), _walking(rng)
        halfway = rng.uniform(-road.right.edge, road.left.edge) - across * pace.distance(traffic.duration / 2)
        traffic.walk(s + rng.uniform(0, 6), halfway, 0, across, pace)


def slow_starters(traffic: Traffic) -> None:
    """Let people and cars stand for 1 to 2 s, and then set off. Parameters are those of `park_cars`."""
    park_cars(traffic)
    road, rng, ego = traffic.road, traffic.rng, traffic.ego
    middle = ego.at(traffic.duration / 2)[0]
    for sign, side in ((1, road.left), (-1, road.right)):
        for s in np.arange(middle + 4, middle + 40, 6.0):
            d = sign * (side.edge + side.strip + rng.uniform(0.4, max(side.walk - 0.4, 0.5)))
            pace = Departure(rng.uniform(1.1, 1.7), rng.uniform(1.0, 2.0), 2.0)
            crosses = rng.random() < 0.4
            along, across = (0, -sign) if crosses else (int(rng.choice([-1, 1])), 0)
            traffic.walk(s + rng.uniform(0, 4), sign * side.edge if crosses else d, along, across, pace)
    for index, along in ((0, -1), (1, 1)):
        for s in np.arange(middle + 12, middle + 45, rng.uniform(9, 13)):
            pace = Departure(rng.uniform(6, 10), rng.uniform(1.0, 2.0), rng.uniform(1.5, 2.5))
            traffic.drive_car(s, (0.5 if index == 0 else -0.5) * road.lane, along, 0, pace)


def crossing_cars(traffic: Traffic) -> None:
    """Let cars cross at the junction, two from each side. Parameters are those of `park_cars`."""
    park_cars(traffic)
    road, rng = traffic.road, traffic.rng
    for sign in (1, -1):
        s, pace = road.junction - sign * road.side_half / 2, Pace(rng.uniform(5, 11))
        halfway = pace.distance(rng.uniform(0.3, 0.7) * traffic.duration)
        for k in range(2):
            traffic.drive_car(s, sign * (halfway + k * rng.uniform(12, 20)), 0, -sign, pace)


def overturned_car(traffic: Traffic) -> None:
    """Let a car lie on its top in the oncoming lane, 10 to 22 m ahead at the end, in the usual traffic.

    Parameters are those of `park_cars`.
    """
    road, rng, ego = traffic.road, traffic.rng, traffic.ego
    end = ego.at(traffic.duration)[0]
    for _ in range(20):  # until the place is free
        look = (traffic.body(), traffic.paint())
        along, across = np.cos(angle := rng.uniform(-0.5, 0.5)), np.sin(angle)
        place = Trajectory(end + rng.uniform(10, 22), 0.5 * road.lane, float(along), float(across), STAND)
        if traffic.park(Kind.CAR, car_size(look[0]), place, look, overturned=True):
            break
    fill_street(traffic)


def _walking(rng: np.random.Generator) -> Pace:
    """Draw how fast a person walks."""
    return Pace(float(np.clip(rng.normal(1.4, 0.2), 0.9, 2.0)))
