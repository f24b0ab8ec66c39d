"""Somebody who takes a study's whole path at a browser, with a mouse, by touch, or with nothing but a keyboard."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from playwright.sync_api import Error, Locator, Page

from study_core.path import (
    ChoiceItem,
    ConsentStep,
    Item,
    LikertItem,
    NumberItem,
    PracticeStep,
    QuestionnaireStep,
    ScaleItem,
    Step,
    questionnaire_of,
)
from study_core.study import Study
from tests.e2e.person import WAIT_MS, Person

_MOST_TABS = 150

# Which page it is: the trial, a step of the path, or the last one.
_PLACE = """() => {
  if (document.querySelector("body.trial")) return "trial";
  const step = document.querySelector("input[name=_step]");
  return step ? `step ${step.value}` : document.querySelector("main") ? "other" : "";
}"""

_IS_OPEN = """() => document.body.matches(".is-break")
  || (!document.body.matches(".is-preparing") && !document.querySelector("#answer-first").disabled)"""


class Hands(Protocol):
    """How somebody uses a page."""

    def press(self, target: Locator) -> None:
        """Presses a button, a link or a box."""
        ...

    def answer(self, page: Page, position: str) -> None:
        """Prefers what stands first or second."""
        ...


class Mouse:
    """Points and clicks."""

    def press(self, target: Locator) -> None:
        target.click()

    def answer(self, page: Page, position: str) -> None:
        page.locator(f"#answer-{position}").click()


class Touch:
    """Taps."""

    def press(self, target: Locator) -> None:
        target.tap()

    def answer(self, page: Page, position: str) -> None:
        page.locator(f"#answer-{position}").tap()


class Keyboard:
    """Has no pointer: what can't be reached with the tab key can't be used."""

    def press(self, target: Locator) -> None:
        self._reach(target)
        is_box = target.evaluate("(element) => ['radio', 'checkbox'].includes(element.type)")
        target.page.keyboard.press("Space" if is_box else "Enter")

    def answer(self, page: Page, position: str) -> None:
        page.keyboard.press({"first": "a", "second": "b"}[position])

    def _reach(self, target: Locator) -> None:
        for _ in range(_MOST_TABS):
            if target.evaluate("(element) => element === document.activeElement"):
                return
            if target.evaluate(_IS_IN_FOCUSED_GROUP):
                # Within a group of radio buttons, the arrow keys go from one to the next.
                target.page.keyboard.press("ArrowDown")
            else:
                target.page.keyboard.press("Tab")
        raise AssertionError(f"the tab key doesn't lead to {target}")


_IS_IN_FOCUSED_GROUP = """(element) => {
  const focused = document.activeElement;
  return element.type === "radio" && focused?.type === "radio" && focused.name === element.name;
}"""


@dataclass
class Walker:
    """Somebody on the path.

    Attributes:
        person: At their page.
        study: What they take part in.
        hands: How they use the page.
        answer_item: What they fill in, by item; without it something plausible.
        visited: The pages that they have been on, in order.
    """

    person: Person
    study: Study
    hands: Hands
    answer_item: Callable[[Item], str | None] = lambda item: None
    visited: list[str] = field(default_factory=list)

    @property
    def page(self) -> Page:
        return self.person.page

    def place(self) -> str:
        """Returns which page it is."""
        self.page.wait_for_load_state()
        place: str = self.page.evaluate(_PLACE)
        return place

    def walks(self, until: Callable[[str], bool] = lambda place: place == "other") -> None:
        """Goes along the path until a place; without one, to the last page."""
        while not until(self.place()):
            self.goes_on()

    def goes_on(self) -> None:
        """Does what one page or one question asks."""
        place = self.place()
        self.visited.append(place)
        if place == "trial":
            self.answers()
        else:
            self.takes(self.study.file.path[int(place.split()[1])])

    def answers(self, position: str = "first") -> None:
        """Answers one query, or ends a break."""
        self.page.wait_for_function(_IS_OPEN, timeout=WAIT_MS)
        if self.page.evaluate("() => document.body.matches('.is-break')"):
            self.visited.append("break")
            self._leads_on(lambda: self.hands.press(self.page.locator("#go-on")))
            return
        self._leads_on(lambda: self._gives(position))

    def _gives(self, position: str) -> None:
        self.hands.answer(self.page, position)
        if self.study.file.answering.confidence:
            self.hands.press(self.page.locator("[data-confidence='4']"))

    def takes(self, step: Step) -> None:
        """Fills in a page and sends it."""
        name = questionnaire_of(step)
        if isinstance(step, (QuestionnaireStep, PracticeStep)) and name is not None:
            for item in self.study.file.questionnaire[name]:
                self._fills_in(item)
        button = "button[name=accept][value=yes]" if isinstance(step, ConsentStep) else "form button.begin"
        self._leads_on(lambda: self.hands.press(self.page.locator(button)))

    def _fills_in(self, item: Item) -> None:
        wanted = self.answer_item(item)
        fields = self.page.locator(f"[name='{item.name}']")
        if isinstance(item, ChoiceItem):
            options = [option.name for option in item.options if option.name not in item.screens_out]
            self._picks(item.name, wanted or item.right or options[0])
        elif isinstance(item, LikertItem):
            self._picks(item.name, wanted or str(item.points))
        elif isinstance(item, ScaleItem):
            slider = self.page.locator(f"#question-{item.name}")
            slider.focus()
            self.page.keyboard.press("ArrowRight")
        else:
            typed = wanted or (
                str(int(item.least or 0) + 20) if isinstance(item, NumberItem) else "Grüße <b>&"
            )
            fields.focus()
            self.page.keyboard.type(typed)

    def _picks(self, name: str, value: str) -> None:
        box = self.page.locator(f"input[name='{name}'][value='{value}']")
        # The words around a box can be pressed like the box itself; a pointer has more to aim at there.
        self.hands.press(box if isinstance(self.hands, Keyboard) else box.locator("xpath=ancestor::label"))

    def _leads_on(self, act: Callable[[], None]) -> None:
        """Does something, and waits until the page shows something else."""
        before = self._sight()
        act()
        for _ in range(WAIT_MS // 50):
            self.page.wait_for_timeout(50)
            if self._sight() not in (before, None):
                return
        raise AssertionError(f"nothing came after {before} in {WAIT_MS // 1000} s")

    def _sight(self) -> str | None:
        """Returns what tells one page or question from the next; None while the next is loading."""
        try:
            sight: str | None = self.page.evaluate(
                """() => document.readyState !== "complete" ? null : [
                  location.pathname, performance.timeOrigin, document.querySelector("#count")?.textContent,
                  document.body.matches(".is-break")].join(" ")"""
            )
        except Error as error:
            if "context was destroyed" in str(error) or "navigat" in str(error):
                return None
            raise
        return sight
