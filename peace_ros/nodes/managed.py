# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Managed nodes: unconfigured, inactive, active, finalized, as ROS 2 defines them.

With the parameter ``autostart`` a node is active when its constructor returns.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.lifecycle.node import LifecycleNodeMixin

from peace_ros.core.domain import ConfigurationError, PeaceError
from peace_ros.core.node_parameters import Group, LifecycleOptions
from peace_ros.nodes.node import PeaceNode

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE
_HOW = 'configure and activate it (ros2 lifecycle set)'


class ManagedNode(LifecycleNodeMixin, PeaceNode):  # type: ignore[misc]
    """A node whose work a person or a lifecycle manager begins and ends."""

    def __init__(self, name: str, *groups: Group, **options: Any) -> None:
        """Create the node, unconfigured; a subclass calls :meth:`start` at the end.

        Raises:
            ConfigurationError: as for PeaceNode.

        """
        PeaceNode.__init__(self, name, *groups, **options)
        LifecycleNodeMixin.__init__(self)
        self._autostart = self.filled(LifecycleOptions).autostart
        self._refusal: Exception | None = None
        self._before: set[Any] = set()
        self.is_configured = self.is_active = False
        self._tell()
        for service in self.services:
            if service.srv_name.endswith('/change_state'):
                service.callback = self._guarded(service.callback)

    def start(self) -> None:
        """Configure and activate, unless somebody else shall do it.

        Raises:
            Exception: whatever :meth:`configure` or :meth:`activate` raised.

        """
        if not self._autostart:
            self.get_logger().info(f'unconfigured: {_HOW}')
            return
        for trigger in (self.trigger_configure, self.trigger_activate):
            if trigger() is not SUCCESS:
                self.close()
                raise self._refusal or ConfigurationError('the node could not be started')
        self._autostart = False

    def configure(self) -> None:
        """Load and check everything; raise PeaceError when something cannot be used."""

    def activate(self) -> None:
        """Begin to work."""

    def deactivate(self) -> None:
        """Stop working."""

    def cleanup(self) -> None:
        """Free what was configured, also when :meth:`configure` got only half way."""

    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Answer the transition, as all below."""
        self._before = self._entities()
        done = self._attempt(self.configure)
        self.is_configured = done is SUCCESS
        if not self.is_configured:
            self._free()
        return self._told(done)

    def on_activate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Work."""
        done = self._attempt(self.activate)
        self.is_active = done is SUCCESS
        return self._told(done)

    def on_deactivate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Stop."""
        self.is_active = False
        return self._told(self._attempt(self.deactivate))

    def on_cleanup(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Free."""
        self._free()
        self.is_configured = False
        return self._told(SUCCESS)

    def on_shutdown(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and free, from any state."""
        self.close()
        self.diagnostics.inactive = 'finalized: start the node again'
        return SUCCESS

    def close(self) -> None:
        """Stop and free what there is."""
        if self.is_active:
            self.is_active = False
            self._attempt(self.deactivate)
        if self.is_configured:
            self._attempt(self.cleanup)
            self.is_configured = False

    def _attempt(self, step: Callable[[], None]) -> TransitionCallbackReturn:
        """Take a step; a refusal leaves the state as it was, a defect ends the process."""
        try:
            step()
        except PeaceError as error:
            self._refusal = error
            if not self._autostart:
                self.get_logger().error(str(error))
            return FAILURE
        except Exception as error:
            self._refusal = error
            if not self._autostart:
                self.fail(error)
            return TransitionCallbackReturn.ERROR
        return SUCCESS

    def _entities(self) -> set[Any]:
        return {*self.subscriptions, *self.publishers, *self.services, *self.timers}

    def _free(self) -> None:
        self._attempt(self.cleanup)  # rclpy would drop an exception without a word
        for entities, destroy in (
            (self.subscriptions, self.destroy_subscription),
            (self.publishers, self.destroy_publisher),
            (self.services, self.destroy_service),
            (self.timers, self.destroy_timer),
        ):
            for entity in set(entities) - self._before:
                destroy(entity)
        self.diagnostics.clear()

    def _told(self, done: TransitionCallbackReturn) -> TransitionCallbackReturn:
        self._tell()
        return done

    def _tell(self) -> None:
        state = 'inactive' if self.is_configured else 'unconfigured'
        self.diagnostics.inactive = '' if self.is_active else f'{state}: {_HOW}'

    def _guarded(self, change_state: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """Refuse a transition that the state does not have: rclpy raises, which would end us."""

        def answer(request: Any, response: Any) -> Any:
            try:
                return change_state(request, response)
            except RuntimeError as error:
                self.say('lifecycle', f'transition refused: {error}')
                response.success = False
                return response

        return answer
