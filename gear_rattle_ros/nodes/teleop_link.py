"""What the keyboard control knows of a simulator, and asks of it: parameters and services only."""

from collections import deque
from collections.abc import Callable, Mapping
import dataclasses
import math
from typing import Any, Final

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

SHOWN: Final = ('alpha', 'alpha_target', 'alpha_rate', 'beta', 'gamma', 'restitution', 'noise',
                'rate')
# How often the parameters are looked at, and how long an answer may take [s].
LOOK_EVERY: Final = 0.25
ANSWER_WITHIN: Final = 6.0
# A service that has just been discovered may not know yet where to send its answer: ask again.
AGAIN: Final = 1.0


@dataclasses.dataclass(frozen=True)
class Request:
    """A question, and what is made of the answer: words to show, '' for none."""

    client: Client
    message: Any
    take: Callable[[Any], str]
    names: frozenset[str] = frozenset()


class Link:
    """Asks one thing after the other; the newest of several settings of the same things stands."""

    def __init__(self, node: Node, simulator: str) -> None:
        self.values: dict[str, float] = {}
        self.words = ''
        self.paused = False
        self._get = node.create_client(GetParameters, f'{simulator}/get_parameters')
        self._put = node.create_client(
            SetParametersAtomically, f'{simulator}/set_parameters_atomically')
        self._reset = node.create_client(Trigger, f'{simulator}/reset')
        self._pause = node.create_client(SetBool, f'{simulator}/pause')
        self.name = node.resolve_service_name(f'{simulator}/get_parameters').removesuffix(
            '/get_parameters')
        self._waiting: deque[Request] = deque()
        self._asked: Request | None = None
        self._answers: list[Future] = []
        self._since = 0.0
        self._looked = -math.inf

    @property
    def is_here(self) -> bool:
        """Tell whether the simulator has said what its parameters are."""
        return bool(self.values)

    @property
    def is_busy(self) -> bool:
        """Tell whether an answer is awaited."""
        return self._asked is not None or bool(self._waiting)

    @property
    def has_asked(self) -> bool:
        """Tell whether something is still to be set or called; looking does not count."""
        looks = self._asked is None or self._asked.client is self._get
        return bool(self._waiting) or not looks

    def put(self, values: Mapping[str, float], words: str = '') -> None:
        """Set parameters, all or none."""
        message = SetParametersAtomically.Request(parameters=[
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()])
        names = frozenset(values)
        if self._waiting and self._waiting[-1].names == names:
            self._waiting.pop()

        def take(answer: SetParametersAtomically.Response) -> str:
            if not answer.result.successful:
                return f'refused: {answer.result.reason}'
            self.values.update({name: value for name, value in values.items() if name in SHOWN})
            return words

        self._waiting.append(Request(self._put, message, take, names))

    def reset(self) -> None:
        """Set the state to the initial one."""
        self._waiting.append(Request(self._reset, Trigger.Request(), lambda answer: (
            answer.message.split(';')[0] if answer.success else f'refused: {answer.message}')))

    def pause(self, paused: bool) -> None:
        """Stop time, or let it go on."""
        def take(answer: SetBool.Response) -> str:
            if answer.success:
                self.paused = paused
                return ''
            return f'refused: {answer.message}'

        self._waiting.append(Request(self._pause, SetBool.Request(data=paused), take))

    def tick(self, now: float) -> None:
        """Take an answer, ask what is next, or look at the parameters [now in s]."""
        if self._asked is not None and not self._answered(now):
            return
        if not self._get.service_is_ready():
            if self.is_here:
                self._lose(f'{self.name} has gone')
            return
        if self._waiting:
            self._ask(self._waiting.popleft(), now)
        elif now > self._looked + LOOK_EVERY:
            self._ask(Request(self._get, GetParameters.Request(names=SHOWN), self._take), now)

    def _ask(self, request: Request, now: float) -> None:
        self._asked, self._since = request, now
        self._answers = [request.client.call_async(request.message)]

    def _answered(self, now: float) -> bool:
        """Take the answer that is awaited, or ask again, or give the simulator up."""
        request = self._asked
        assert request is not None
        done = [future for future in self._answers if future.done()]
        is_there = self._get.service_is_ready()
        if not done and is_there and now < self._since + ANSWER_WITHIN:
            if now > self._since + AGAIN * len(self._answers):
                self._answers.append(request.client.call_async(request.message))
            return False
        for future in self._answers:
            request.client.remove_pending_request(future)
        self._asked = None
        if done:
            self._looked = now
            self.words = request.take(done[0].result()) or self.words
        else:
            self._lose(f'{self.name} ' + ('does not answer' if is_there else 'has gone'))
        return True

    def _take(self, answer: GetParameters.Response) -> str:
        if [value.type for value in answer.values] != [ParameterType.PARAMETER_DOUBLE] * len(
                SHOWN):
            return f'{self.name} is no simulator of gear rattling: it has no parameter alpha'
        first = not self.is_here
        self.values = {name: value.double_value
                       for name, value in zip(SHOWN, answer.values, strict=True)}
        return f'{self.name} is here' if first else ''

    def _lose(self, words: str) -> None:
        self.values, self.words, self.paused = {}, words, False
        self._waiting.clear()
