"""The road users on a street: ordinary traffic, or the special cases of a test street, such as convoys.

Each public function adds road users to a `Traffic`.
"""

import numpy as np

from semgrid_edu.workshop.simulation.street.layout import Side
from semgrid_edu.workshop.simulation.street.traffic import Traffic
from semgrid_edu.workshop.simulation.street.trajectories import STANDSTILL, ActorPace, Departure, Trajectory
from semgrid_edu.workshop.simulation.things.cars_and_people import car_size
from semgrid_edu.workshop.simulation.things.materials import Kind


def fill_street(traffic: Traffic) -> None:
    """Add parked cars, traffic in every lane, cyclists and pedestrians at the planned density.

    Parameters
    ----------
    traffic : Traffic
        Receives them; contains the street and the plan.
    """
    for fill in (park_cars, _park_bicycles, _lanes, _cross_traffic, _cyclists, _pedestrians):
        fill(traffic)


def park_cars(traffic: Traffic) -> None:
    """Fill the parking bays. Parameters are those of `fill_street`."""
    road = traffic.road
    rng = traffic.rng
    plan = traffic.plan
    for sign, bays in zip((1, -1), plan.parking, strict=True):
        if not bays:
            continue
        share = rng.uniform(0.35, 0.9)
        s = plan.start + 5
        middle = road.side(sign).edge - 1.06
        while s < plan.end - 60:
            s += rng.uniform(5.7, 6.6)
            near = road.side_half and abs(s - road.junction) < road.side_half + road.corner + 9
            if rng.random() > share or near:
                continue
            body = traffic.body()
            away = (sign > 0) != (rng.random() < 0.12)
            d = sign * (middle + rng.normal(0, 0.05))
            yaw = rng.normal(0, 0.02) + np.pi * away
            traffic.park(Kind.CAR, Trajectory(s, d, 1, 0, STANDSTILL, yaw), (body, traffic.paint()))


def _park_bicycles(traffic: Traffic) -> None:
    """Park a few bicycles on the sidewalks."""
    road = traffic.road
    rng = traffic.rng
    for sign in (1, -1):
        side = road.side(sign)
        for _ in range(rng.integers(0, 5) if side.walk >= 1.5 else 0):
            s = rng.uniform(4, 70)
            n = rng.integers(1, 4)
            for k in range(n):
                d = sign * (side.edge + side.strip + rng.choice([0.5, side.walk - 0.35]))
                place = Trajectory(s + 0.75 * k, d, 1, 0, STANDSTILL, rng.normal(0, 0.15) + (1.3 if n > 1 else 0))
                traffic.park(Kind.BICYCLE, place, ("bicycle", traffic.paint()))


def _lanes(traffic: Traffic) -> None:
    """Fill every lane with cars at equal speed, so that none catches up with the next."""
    road = traffic.road
    rng = traffic.rng
    ego = traffic.ego
    waiting = ego.pace.mean == 0
    ego_lane = round(-ego.d / road.lane - 0.5)
    for index in range(road.lanes_right):
        faster = rng.uniform(2.5, 7.0) if index < ego_lane else -rng.uniform(1.0, 2.5)
        pace = ego.pace if index == ego_lane or waiting else ActorPace(max(ego.pace.mean + faster, 3.0))
        _fill_lane(traffic, -(index + 0.5) * road.lane, 1, pace)
    overtaken = road.lanes_right == 1 and not waiting and rng.random() < 0.22
    for index in range(road.lanes_left):
        d = (index + 0.5) * road.lane
        if overtaken and index == 0:
            at_end = traffic.ends_at + rng.uniform(4, 22)
            pace = ActorPace(ego.pace.mean + rng.uniform(4, 7))
            traffic.drive_car(at_end - pace.distance(traffic.duration), d, 1, 0, pace)
        else:
            _fill_lane(traffic, d, -1, STANDSTILL if waiting else ActorPace(rng.uniform(7, 14)))


def _fill_lane(traffic: Traffic, d: float, along: int, pace: ActorPace) -> None:
    """Fill a lane with cars at equal speed that are around the recording car at the end of the drive."""
    road = traffic.road
    rng = traffic.rng
    density = traffic.plan.density
    travelled = pace.distance(traffic.duration)
    reach = road.side_half + road.corner
    gap = 6.5 + (0.8 * pace.mean if pace.mean else 0.0)
    s = traffic.ends_at - 30 + rng.uniform(0, 15)
    while s < traffic.ends_at + 110:
        ahead = (s - road.junction) * along
        blocked = road.side_half and pace.mean == 0 and -(reach + 8) < ahead < road.side_half + 12
        if not blocked and rng.random() < 0.25 + 0.6 * density:
            traffic.drive_car(s - along * travelled, d + rng.normal(0, 0.12), along, 0, pace)
        s += gap + rng.exponential(3.0 + 28 * (1 - density))


def _cross_traffic(traffic: Traffic) -> None:
    """Add cars that wait in the side road, drive away on it, or cross while our traffic waits."""
    road = traffic.road
    rng = traffic.rng
    for sign in filter(road.leaves, (1, -1)):
        towards, away = (road.junction - way * sign * road.side_half / 2 for way in (1, -1))
        edge = road.side(sign).edge
        back = edge + road.corner + 3.5
        for _ in range(rng.integers(0, 1 + round(3 * traffic.plan.density))):
            traffic.drive_car(towards, sign * back, 0, -sign, STANDSTILL)
            back += rng.uniform(6.0, 9.0)
        if rng.random() < 0.6:
            start = edge + rng.uniform(6, 40)
            traffic.drive_car(away, sign * start, 0, sign, ActorPace(rng.uniform(4, 9)))
        if traffic.ego.pace.mean == 0 and rng.random() < 0.7:
            pace = ActorPace(rng.uniform(5, 9))
            end = rng.uniform(-8, 8)
            traffic.drive_car(towards, sign * (end + pace.distance(traffic.duration)), 0, -sign, pace)


def _cyclists(traffic: Traffic) -> None:
    """Add cyclists at the edge of the outer lanes."""
    road = traffic.road
    rng = traffic.rng
    for _ in range(rng.poisson(0.5 + 1.6 * traffic.plan.density)):
        pace = ActorPace(rng.uniform(3.5, 6.5))
        along = int(rng.choice([1, 1, -1]))
        lanes = road.lanes_right if along > 0 else road.lanes_left
        d = -along * (lanes * road.lane - rng.uniform(0.35, 0.6))
        traffic.ride(traffic.ends_at + rng.uniform(4, 40) - along * pace.distance(traffic.duration), d, along, pace)


def _pedestrians(traffic: Traffic) -> None:
    """Add people who walk or stand on the sidewalks, and people who cross the road."""
    road = traffic.road
    rng = traffic.rng
    here = traffic.ends_at
    for sign in (1, -1):
        side = road.side(sign)
        for _ in range(rng.poisson(1.0 + 5.0 * traffic.plan.density) if side.walk > 1 else 0):
            d = sign * (side.edge + side.strip + rng.uniform(0.45, side.walk - 0.35))
            s = here + rng.uniform(3, 55)
            along = int(rng.choice([-1, 1]))
            if rng.random() < 0.15:
                traffic.walk(s, d, 1, 0, STANDSTILL, rng.uniform(-np.pi, np.pi))
                continue
            pace = ActorPace(float(np.clip(rng.normal(1.4, 0.18), 1.0, 1.9)))
            if traffic.walk(s, d, along, 0, pace) and rng.random() < 0.35:
                traffic.walk(s + 0.1, d + rng.choice([-0.75, 0.75]), along, 0, pace)
    for _ in range(rng.poisson(0.4 + 0.9 * traffic.plan.density)):
        pace = ActorPace(float(rng.normal(1.4, 0.15)))
        across = int(rng.choice([-1, 1]))
        back = road.side_half + road.corner + rng.uniform(1.0, 3.2)
        s = road.junction - back if road.side_half and road.zebra else here + rng.uniform(9, 35)
        end = rng.uniform(-road.right.edge, road.left.edge)
        traffic.walk(s, end - across * pace.distance(traffic.duration), 0, across, pace)


def convoys(traffic: Traffic) -> None:
    """Add an oncoming convoy of two or three cars, and two cars that overtake in our left lane.

    The gaps are 8 to 20 m, so the first car initially hides the next one. Parameters are those of `fill_street`.
    """
    park_cars(traffic)
    road = traffic.road
    rng = traffic.rng
    ego = traffic.ego
    oncoming = ActorPace(rng.uniform(8, 14))
    meets = rng.uniform(0.6, 1.1) * traffic.duration
    first = ego.at(meets)[0] + oncoming.distance(meets)
    _convoy(traffic, first, 0.5 * road.lane, -1, oncoming, int(rng.integers(2, 4)))
    overtaking = ActorPace(ego.pace.mean + rng.uniform(2, 5))
    ahead = traffic.ends_at + rng.uniform(20, 35) - overtaking.distance(traffic.duration)
    _convoy(traffic, ahead, -0.5 * road.lane, 1, overtaking, 2)


def _convoy(traffic: Traffic, s: float, d: float, along: int, pace: ActorPace, cars: int) -> None:
    """Add cars that follow each other; the first one starts at s."""
    for _ in range(cars):
        look = (traffic.body(), traffic.paint())
        traffic.drive_car(s, d, along, 0, pace, look)
        s -= along * (car_size(look[0])[0] + traffic.rng.uniform(8, 20))


def _walking(rng: np.random.Generator) -> ActorPace:
    """Draw a walking speed."""
    return ActorPace(float(np.clip(rng.normal(1.4, 0.2), 0.9, 2.0)))


def _on_sidewalk(side: Side, rng: np.random.Generator) -> float:
    """Draw a position on the sidewalk: its distance from the centre line, metres."""
    return side.edge + side.strip + rng.uniform(0.4, max(side.walk - 0.4, 0.5))


def pedestrians(traffic: Traffic) -> None:
    """Add people who walk along both sidewalks and across the road. Parameters are those of `fill_street`."""
    park_cars(traffic)
    road = traffic.road
    rng = traffic.rng
    middle = traffic.ego.at(traffic.duration / 2)[0]
    for sign in (1, -1):
        for s in np.arange(middle + 2, middle + 55, 5.0):
            d = sign * _on_sidewalk(road.side(sign), rng)
            traffic.walk(s + rng.uniform(0, 4), d, int(rng.choice([-1, 1])), 0, _walking(rng))
    for s in np.arange(middle + 8, middle + 50, 8.0):
        across = int(rng.choice([-1, 1]))
        pace = _walking(rng)
        halfway = rng.uniform(-road.right.edge, road.left.edge) - across * pace.distance(traffic.duration / 2)
        traffic.walk(s + rng.uniform(0, 6), halfway, 0, across, pace)


def slow_starters(traffic: Traffic) -> None:
    """Add people and cars that wait for 1 to 2 s and then start. Parameters are those of `fill_street`."""
    park_cars(traffic)
    road = traffic.road
    rng = traffic.rng
    middle = traffic.ego.at(traffic.duration / 2)[0]
    for sign in (1, -1):
        side = road.side(sign)
        for s in np.arange(middle + 4, middle + 40, 6.0):
            d = sign * _on_sidewalk(side, rng)
            pace = Departure(rng.uniform(1.1, 1.7), rng.uniform(1.0, 2.0), 2.0)
            crosses = rng.random() < 0.4
            along, across = (0, -sign) if crosses else (int(rng.choice([-1, 1])), 0)
            traffic.walk(s + rng.uniform(0, 4), sign * side.edge if crosses else d, along, across, pace)
    for along in (-1, 1):
        for s in np.arange(middle + 12, middle + 45, rng.uniform(9, 13)):
            pace = Departure(rng.uniform(6, 10), rng.uniform(1.0, 2.0), rng.uniform(1.5, 2.5))
            traffic.drive_car(s, -along * 0.5 * road.lane, along, 0, pace)


def crossing_cars(traffic: Traffic) -> None:
    """Add cars that cross at the junction, two from each side. Parameters are those of `fill_street`."""
    park_cars(traffic)
    road = traffic.road
    rng = traffic.rng
    for sign in (1, -1):
        s = road.junction - sign * road.side_half / 2
        pace = ActorPace(rng.uniform(5, 11))
        halfway = pace.distance(rng.uniform(0.3, 0.7) * traffic.duration)
        for k in range(2):
            traffic.drive_car(s, sign * (halfway + k * rng.uniform(12, 20)), 0, -sign, pace)


def overturned_car(traffic: Traffic) -> None:
    """Add an overturned car in the oncoming lane, 10 to 22 m ahead at the end of the drive, in ordinary traffic.

    Parameters are those of `fill_street`.
    """
    rng = traffic.rng
    for _ in range(20):  # until the place is free
        look = (traffic.body(), traffic.paint())
        angle = rng.uniform(-0.5, 0.5)
        s = traffic.ends_at + rng.uniform(10, 22)
        direction = (float(np.cos(angle)), float(np.sin(angle)))
        place = Trajectory(s, 0.5 * traffic.road.lane, *direction, STANDSTILL)
        if traffic.park(Kind.CAR, place, look, overturned=True):
            break
    fill_street(traffic)


def sample_traffic(traffic: Traffic) -> None:
    """Put an overtaking and an oncoming car, a cyclist and pedestrians in view of the camera, then fill the street.

    Parameters are those of `fill_street`.
    """
    road = traffic.road
    end = traffic.duration
    here = traffic.ends_at
    overtaking = ActorPace(traffic.ego.pace.mean + 6.0)
    oncoming = ActorPace(9.0)
    cycling = ActorPace(5.0)
    red = ("estate", (0.35, 0.02, 0.02))
    blue = ("hatchback", (0.05, 0.12, 0.35))
    traffic.drive_car(here + 9.0 - overtaking.distance(end), -0.5 * road.lane, 1, 0, overtaking, red)
    traffic.drive_car(here + 14.0 + oncoming.distance(end), 0.5 * road.lane, -1, 0, oncoming, blue)
    traffic.ride(here + 9.0 - cycling.distance(end), -(road.lanes_right * road.lane - 0.45), 1, cycling)
    for sign, ahead in ((-1, 12.0), (1, 17.0)):
        side = road.side(sign)
        walk = sign * (side.edge + side.strip + 0.6 * side.walk)
        traffic.walk(here + ahead, walk, sign, 0, ActorPace(1.4))
        traffic.walk(here + ahead + 9.0, walk, -sign, 0, STANDSTILL, 1.0)
    fill_street(traffic)
