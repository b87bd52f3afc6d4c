"""Measurement sets: reading them strictly, checking that they can be right, writing them, converting ROS bags."""

from forcegrasp.measure.check_servo import check_servo
from forcegrasp.measure.checks import check_set, check_table
from forcegrasp.measure.read import read_set
from forcegrasp.measure.rosbag import convert_bag
from forcegrasp.measure.schema import FinalForceTable, MeasuredGrasp, MeasurementSet
from forcegrasp.measure.write import write_servo_set, write_set, write_table

__all__ = [
    "FinalForceTable",
    "MeasuredGrasp",
    "MeasurementSet",
    "check_servo",
    "check_set",
    "check_table",
    "convert_bag",
    "read_set",
    "write_servo_set",
    "write_set",
    "write_table",
]
