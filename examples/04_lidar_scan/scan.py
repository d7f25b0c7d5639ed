"""Waits for one laser scan and one point cloud, with Zenoh only, and draws them.

Usage: python scan.py [ENDPOINT] [FILE]      (default tcp/127.0.0.1:7447, lidar.png in the current folder)
"""

import json
import queue
import sys
from pathlib import Path

import cv2
import zenoh
from picture import picture

from mjplug_schemas.sensor_msgs import LaserScan, PointCloud2

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"]))

file = Path(sys.argv[2] if len(sys.argv) > 2 else "lidar.png")


def main() -> int:
    """Writes the picture; returns 0, or 1 if no message arrived."""
    with zenoh.open(config) as session:
        scans: queue.Queue[LaserScan] = queue.Queue()
        clouds: queue.Queue[PointCloud2] = queue.Queue()
        session.declare_subscriber("scan", lambda sample: scans.put(LaserScan.from_cdr(sample.payload.to_bytes())))
        session.declare_subscriber("points", lambda sample: clouds.put(PointCloud2.from_cdr(sample.payload.to_bytes())))
        try:
            scan, cloud = scans.get(timeout=20.0), clouds.get(timeout=20.0)
        except queue.Empty:
            print("nothing is published: is the server paused?", file=sys.stderr)
            return 1

    near = [r for r in scan.ranges if scan.range_min <= r <= scan.range_max]
    print(f"scan: {len(scan.ranges)} ranges in frame {scan.header.frame_id}, the nearest {min(near):.2f} m", flush=True)
    print(f"cloud: {cloud.height} rows of {cloud.width} points in frame {cloud.header.frame_id}", flush=True)
    cv2.imwrite(str(file), picture(scan, cloud))
    print(f"drawn: {file.resolve()}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
