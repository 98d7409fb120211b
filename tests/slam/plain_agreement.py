# mypy: disallow-untyped-defs=False, check-untyped-defs=True
"""What several discs agree on, array by array: the form that the kernels of `slam/` must agree with."""

import math

import numpy as np

from sonar_explore.geometry import Pose, wrap_angle
from sonar_explore.slam.ends import neighbours
from sonar_explore.slam.features import Feature, FeatureKind, extract_features, tangent
from sonar_explore.slam.rcd import regions_of_constant_depth
from sonar_explore.slam.turn.agreement import Extraction
from sonar_explore.slam.turn.columns import told_by_width
from sonar_explore.slam.turn.discs import TurnError, aside
from sonar_explore.slam.turn.points import Point


def plain_extraction(scan, config, agreement):
    """`agreement.extract` of a scan of several discs."""
    discs = (scan, *scan.others)
    heard = [extract_features(disc, config) for disc in discs]
    walls = np.array(
        [
            (k, f.bearing_rad, f.range_m, f.sweep_rad, f.width_rad, aside(discs[k].pose_sonar_in_robot))
            for k, features in enumerate(heard)
            for f in features
            if f.kind is FeatureKind.WALL
        ]
    ).reshape(-1, 6)
    turned = np.abs(wrap_angle(walls[:, None, 1] - walls[None, :, 1])) / agreement.bearing_rad
    farther = np.abs(walls[:, None, 2] - walls[None, :, 2]) / agreement.range_m
    distance = np.where((turned <= 1.0) & (farther <= 1.0), turned + farther, np.inf)
    found, swept = [], []
    for rows in plain_things(distance, walls[:, 0], walls[:, 1], agreement.discs_min):
        thing = walls[rows]
        thing[:, 1] = thing[0, 1] + wrap_angle(thing[:, 1] - thing[0, 1])
        found.append(_wall_or_point(thing, heard[0], config, agreement))
        if found[-1].kind is FeatureKind.WALL:
            swept.append((thing[:, 3], thing[:, 1]))
    alone = [
        f
        for f in heard[0]
        if f.kind is not FeatureKind.WALL
        and not any(_near(f, a.bearing_rad, a.range_m, agreement) for a in found)
    ]
    points, also = plain_points(scan, config, agreement.points)
    features = tuple(sorted([*found, *alone], key=lambda f: f.bearing_rad))
    return Extraction(points, plain_turn([*swept, *also], agreement.noise_rad), of_one_disc=features)


def plain_things(distance, disc, order, least):
    """Rows of each thing: what most discs heard first, then the closest; one row a disc."""
    things, distance, of_disc = [], distance.copy(), [np.flatnonzero(disc == k) for k in np.unique(disc)]
    while len(distance):
        nearest = np.column_stack([distance[:, rows].min(axis=1) for rows in of_disc])
        count = np.isfinite(nearest).sum(axis=1)
        if count.max() < least:
            break
        spread = np.where(np.isfinite(nearest), nearest, 0.0).sum(axis=1)
        seed = np.lexsort((order, spread.round(9), -count))[0]
        heard_it = [rows for rows, near in zip(of_disc, nearest[seed], strict=True) if np.isfinite(near)]
        members = np.array([rows[np.argmin(distance[seed, rows])] for rows in heard_it])
        things.append(members.tolist())
        distance[members, :] = distance[:, members] = np.inf
    return things


def _wall_or_point(thing, own, config, agreement):
    _, bearing, depth, sweep, width = thing[:, :5].mean(axis=0)
    beside = thing[:, 5] / depth
    lever = beside - beside.mean()
    scatter = lever @ lever
    share = lever @ thing[:, 1] / scatter if scatter > 1e-9 else 0.0
    kind = FeatureKind.WALL
    if abs(share) > agreement.point_share:
        kind, bearing = FeatureKind.EDGE, bearing - share * beside.mean()
    walls = [f for f in own if f.kind is FeatureKind.WALL and _near(f, bearing, depth, agreement)]
    segment = tangent(kind, bearing, depth, width, config)
    readings = walls[0].readings if walls else ()
    return Feature(kind, wrap_angle(bearing), depth, width, segment, readings, sweep, len(thing))


def _near(feature, bearing, depth, agreement):
    turned = abs(wrap_angle(feature.bearing_rad - bearing))
    return turned <= agreement.bearing_rad and abs(feature.range_m - depth) <= agreement.range_m


def plain_echoes(scan, features, config):
    """Places x y of what one disc heard in front of all beside it, how far the robot had turned, `aside`, over which
    turn it was heard, and how far off the disc it was."""
    mount, n = scan.pose_sonar_in_robot, len(scan.ranges_m)
    for region in regions_of_constant_depth(scan, features.tolerance_m):
        beside = min(scan.ranges_m[i] for i in neighbours(region.readings, n))
        in_reach = features.range_min_m <= region.echo_m <= features.range_max_m
        fits = config.width_min_rad <= region.width_rad <= config.width_max_rad
        if in_reach and fits and beside >= region.echo_m + config.in_front_m:
            disc = Pose(0.0, 0.0, region.bearing_rad - mount.heading) @ mount
            place = disc.transform(np.array([[region.echo_m, 0.0]]))[0]
            turned = 0.5 * sum(scan.headings_rad[region.readings[k]] for k in (0, -1))
            yield (*place, turned, aside(mount), region.width_rad + scan.step_rad, region.echo_m)


def plain_points(scan, features, config):
    """Points, and for each how far the robot had turned when each disc heard it, and at what bearing, less the mean."""
    heard = np.array(
        [
            (k, *echo)
            for k, disc in enumerate((scan, *scan.others))
            for echo in plain_echoes(disc, features, config)
        ]
    ).reshape(-1, 7)
    off = np.hypot(*(heard[:, None, 1:3] - heard[None, :, 1:3]).transpose(2, 0, 1))
    distance = np.where(off <= config.together_m, off, np.inf)
    points, swept = [], []
    for rows in plain_things(distance, heard[:, 0], heard[:, 3], config.discs_min):
        places, turned, beside = heard[rows, 1:3], heard[rows, 3], heard[rows, 4]
        x, y = places.mean(axis=0)
        depth = math.hypot(x, y)
        along, lever = (places - (x, y)) @ np.array([-y, x]) / depth, beside - beside.mean()
        scatter = lever @ lever
        plane = scatter > 1e-9 and abs(lever @ along) > config.plane_share * scatter
        if depth >= config.near_m and not plane:
            bearing, (width, echo) = math.atan2(y, x), heard[rows, 5:].mean(axis=0)
            told = told_by_width(width, depth, echo, features.beam, config.columns)
            if told:
                points.append(Point(bearing, depth, turned.mean(), len(rows), *told))
            swept.append((turned, wrap_angle(np.arctan2(*places.T[::-1]) - bearing)))
    return tuple(points), swept


def plain_turn(heard, noise_rad):
    """`TurnError` of what several discs heard."""
    swept = [sweep - sweep.mean() for sweep, _ in heard]
    weight = sum((sweep**2).sum() for sweep in swept)
    pull = sum(sweep @ bearing for sweep, (_, bearing) in zip(swept, heard, strict=True))
    return TurnError(-pull / weight, noise_rad / math.sqrt(weight)) if weight > 0.0 else None
