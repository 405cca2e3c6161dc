"""Reaching a running simulator from elsewhere: set its next initial state, and reset it."""

import math
from typing import Any

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
import rclpy
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

# How long a simulator may take to be found, on a machine that is busy too, and to answer [s].
FOUND_WITHIN = 5.0
ANSWERS_WITHIN = 5.0
BELOW_TWO_PI = math.nextafter(2.0 * math.pi, 0.0)


class SteeringError(Exception):
    """The simulator cannot be steered; the message is one line."""


class Steering:
    """A node of its own, in a context of its own, that talks to one simulator."""

    def __init__(self, simulator: str = '/simulator', name: str = 'steering') -> None:
        self._simulator = simulator
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node: Node = rclpy.create_node(
            name, context=self._context, enable_rosout=False, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._get = self._node.create_client(GetParameters, f'{simulator}/get_parameters')
        self._set = self._node.create_client(
            SetParametersAtomically, f'{simulator}/set_parameters_atomically')
        self._reset = self._node.create_client(Trigger, f'{simulator}/reset')

    def send(self, phase: float, displacement: float, velocity: float) -> dict[str, float]:
        """Begin anew from a state; returns the simulator's alpha, beta, gamma, restitution."""
        state = {'initial_phase': min(max(phase, 0.0), BELOW_TWO_PI),
                 'initial_displacement': displacement, 'initial_velocity': velocity}
        done = self._call(self._set, SetParametersAtomically.Request(parameters=[
            Parameter(name=name, value=ParameterValue(
                type=ParameterType.PARAMETER_DOUBLE, double_value=float(value)))
            for name, value in state.items()]))
        if not done.result.successful:
            raise SteeringError(f'{self._simulator} refuses the state: {done.result.reason}')
        answer = self._call(self._reset, Trigger.Request())
        if not answer.success:
            raise SteeringError(f'{self._simulator} refuses the reset: {answer.message}')
        names = ['alpha', 'beta', 'gamma', 'restitution']
        values = self._call(self._get, GetParameters.Request(names=names)).values
        return {name: float(value.double_value)
                for name, value in zip(names, values, strict=True)}

    def close(self) -> None:
        """Leave the ROS graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def _call(self, client: Client, request: Any) -> Any:
        if not client.wait_for_service(FOUND_WITHIN):
            raise SteeringError(f'no simulator answers as {self._simulator}; start one with: '
                                'ros2 run gear_rattle_ros simulator')
        future = client.call_async(request)
        self._executor.spin_until_future_complete(future, ANSWERS_WITHIN)
        if not future.done():
            raise SteeringError(f'{self._simulator} has not answered for {ANSWERS_WITHIN:g} s')
        return future.result()
