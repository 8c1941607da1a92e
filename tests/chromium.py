"""Drives a real Chromium (Qt WebEngine, from the wheel PyQt6-WebEngine of the extra `browser`) without a display, in a
process of its own.

`browse` takes steps and returns one result for each:
    ["open", file, width]                     load a local file in a window that wide; gives the console's messages
    ["js", code]                              the value of an expression in the page
    ["click", selector]                       a mouse click on the middle of the first such element, scrolled into view
    ["hover", selector, x, y]                 the mouse on a point of that element, in parts of its width and height
    ["drag", selector, x0, y0, x1, y1]        a drag from one such point to another
    ["double", selector, x, y]                a double click on such a point
    ["requests"]                              addresses that the pages asked for, but for the files opened
    ["key", selector, name]                   a key (Qt's name, such as "Down") with the focus on that element
    ["shot", path]                            a picture of the window
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

_HEIGHT = 844
CONTRAST = """(() => {
  const lum = (c) => { const [r, g, b] = c.match(/[\\d.]+/g).slice(0, 3)
      .map((v) => v / 255).map((v) => v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4);
    return .2126 * r + .7152 * g + .0722 * b; };
  const paper = lum(getComputedStyle(document.body).backgroundColor);
  const ratio = (c) => { const l = lum(c); return (Math.max(l, paper) + .05) / (Math.min(l, paper) + .05); };
  const of = (s, what) => [...document.querySelectorAll(s)].map((e) => ratio(getComputedStyle(e)[what]));
  const text = of('p, td, th, a, dt, dd, .small, figcaption, summary', 'color');
  return [Math.min(...text), Math.min(...of('.line', 'stroke')), paper];
})()"""
"""Least ratio of luminances of a text to the page, and of a line of a drawing; luminance of the page."""


def browse(steps: list[list[Any]], scheme: str = "light") -> list[Any]:
    """Results of the steps; skips the test with the reason where the browser cannot be loaded."""
    flags = f"--no-sandbox --disable-gpu --blink-settings=preferredColorScheme={0 if scheme == 'dark' else 1}"
    env = os.environ | {
        "QT_QPA_PLATFORM": "offscreen",
        "QTWEBENGINE_DISABLE_SANDBOX": "1",
        "QTWEBENGINE_CHROMIUM_FLAGS": flags,
    }
    done = subprocess.run(
        [sys.executable, __file__, json.dumps(steps)], capture_output=True, text=True, env=env, timeout=120, check=False
    )
    if done.returncode == 77:
        assert not os.environ.get("SHIPBENCH_NEEDS_BROWSER"), (
            f"SHIPBENCH_NEEDS_BROWSER is set and no browser starts: {done.stdout.strip()}"
        )
        pytest.skip(f"no browser: {done.stdout.strip()}")
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)


def _main(steps: list[list[Any]]) -> int:
    try:
        from PyQt6.QtCore import QEventLoop, QPoint, Qt, QUrl
        from PyQt6.QtTest import QTest
        from PyQt6.QtWebEngineCore import QWebEnginePage, QWebEngineProfile, QWebEngineUrlRequestInterceptor
        from PyQt6.QtWebEngineWidgets import QWebEngineView
        from PyQt6.QtWidgets import QApplication
    except ImportError as error:  # not installed, or a library of the system is missing
        print(error)
        return 77
    app = QApplication(["chromium"])  # kept: Qt ends with it
    assert app is not None
    console: list[str] = []

    class Page(QWebEnginePage):
        def javaScriptConsoleMessage(self, level, message, line, source):
            console.append(message)

    asked: list[str] = []
    opened: list[str] = []

    class Requests(QWebEngineUrlRequestInterceptor):
        def interceptRequest(self, info):
            asked.append(info.requestUrl().toString())

    interceptor = Requests()
    profile = QWebEngineProfile()  # off the record: nothing is kept on disk
    profile.setUrlRequestInterceptor(interceptor)
    view = QWebEngineView()
    page = Page(profile, view)
    view.setPage(page)
    view.show()

    def js(code: str) -> Any:
        loop, found = QEventLoop(), []
        page.runJavaScript(code, lambda value: (found.append(value), loop.quit()))
        loop.exec()
        return found[0]

    def load(file: str, width: int) -> list[str]:
        view.resize(width, _HEIGHT)
        loop, went = QEventLoop(), []
        finished = page.loadFinished.connect(lambda ok: (went.append(ok), loop.quit()))
        url = QUrl.fromLocalFile(str(Path(file).resolve()))
        opened.append(url.toString())
        page.load(url)
        loop.exec()
        page.loadFinished.disconnect(finished)
        assert went == [True], f"{file} does not load"
        QTest.qWait(150)
        return list(console)

    def click(selector: str) -> None:
        quoted = json.dumps(selector)
        js(f"document.querySelector({quoted}).scrollIntoView({{block: 'center', inline: 'center'}})")
        QTest.qWait(60)
        x, y = js(
            f"(() => {{ const b = document.querySelector({quoted}).getBoundingClientRect(); return [b.x + b.width / "
            "2, b.y + b.height / 2]; })()"
        )
        QTest.mouseClick(
            view.focusProxy(), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, QPoint(round(x), round(y))
        )
        QTest.qWait(100)

    def point(selector: str, x: float, y: float) -> QPoint:
        quoted = json.dumps(selector)
        box = js(
            f"(() => {{ const e = document.querySelector({quoted}); e.scrollIntoView({{block: 'center', behavior: "
            "'instant'}); "
            "const b = e.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; })()"
        )
        QTest.qWait(60)
        return QPoint(round(box[0] + x * box[2]), round(box[1] + y * box[3]))

    def hover(selector: str, x: float, y: float) -> None:
        at = point(selector, x, y)
        for shift in (3, 0):  # a browser tells of a move only where the mouse was elsewhere
            QTest.mouseMove(view.focusProxy(), at - QPoint(shift, 0))
            QTest.qWait(120)

    def drag(selector: str, x0: float, y0: float, x1: float, y1: float) -> None:
        start, end = point(selector, x0, y0), point(selector, x1, y1)
        left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
        QTest.mouseMove(view.focusProxy(), start)
        QTest.mousePress(view.focusProxy(), left, none, start)
        for part in (0.3, 0.7, 1.0):
            QTest.mouseMove(view.focusProxy(), start + (end - start) * part)
            QTest.qWait(60)
        QTest.mouseRelease(view.focusProxy(), left, none, end)
        QTest.qWait(300)

    def double(selector: str, x: float, y: float) -> None:
        at = point(selector, x, y)
        left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
        QTest.mouseMove(view.focusProxy(), at)
        QTest.mouseClick(view.focusProxy(), left, none, at)
        QTest.mouseClick(view.focusProxy(), left, none, at, 30)
        QTest.qWait(400)

    def key(selector: str, name: str) -> None:
        js(f"document.querySelector({json.dumps(selector)}).focus()")
        QTest.keyClick(view.focusProxy(), getattr(Qt.Key, f"Key_{name}"))
        QTest.qWait(100)

    def shot(path: str) -> bool:
        QTest.qWait(150)
        return view.grab().save(path)

    def requests() -> list[str]:
        return [url for url in asked if url not in opened]

    actions = {
        "open": load, "js": js, "click": click, "key": key, "shot": shot, "hover": hover, "drag": drag,
        "double": double, "requests": requests,
    }  # fmt: skip
    results = [actions[name](*values) for name, *values in steps]
    print(json.dumps(results))
    sys.stdout.flush()
    os._exit(0)  # Qt complains where pages end after their profile; nothing is to be cleaned up


if __name__ == "__main__":
    sys.exit(_main(json.loads(sys.argv[1])))
