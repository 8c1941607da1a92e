"""Drives a real Chromium (Qt WebEngine, from the wheel PyQt6-WebEngine of the extra `browser`) without a display, in a process of its own.

`browse` takes steps and returns one result for each:
    ["open", file, width, "light" or "dark"]  load a local file in a window that wide; gives the messages of the console since the start
    ["js", code]                              the value of an expression in the page
    ["click", selector]                       a mouse click on the middle of the first such element, scrolled into view
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


def browse(steps: list[list[Any]], scheme: str = "light") -> list[Any]:
    """Results of the steps; skips the test with the reason where the browser cannot be loaded."""
    flags = f"--no-sandbox --disable-gpu --blink-settings=preferredColorScheme={0 if scheme == 'dark' else 1}"
    env = os.environ | {"QT_QPA_PLATFORM": "offscreen", "QTWEBENGINE_DISABLE_SANDBOX": "1", "QTWEBENGINE_CHROMIUM_FLAGS": flags}
    done = subprocess.run([sys.executable, __file__, json.dumps(steps)], capture_output=True, text=True, env=env, timeout=120, check=False)
    if done.returncode == 77:
        pytest.skip(f"no browser: {done.stdout.strip()}")
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)


def _main(steps: list[list[Any]]) -> int:
    try:
        from PyQt6.QtCore import QEventLoop, QPoint, Qt, QUrl
        from PyQt6.QtTest import QTest
        from PyQt6.QtWebEngineCore import QWebEnginePage, QWebEngineProfile
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

    profile = QWebEngineProfile()  # off the record: nothing is kept on disk
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
        page.load(QUrl.fromLocalFile(str(Path(file).resolve())))
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
            f"(() => {{ const b = document.querySelector({quoted}).getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; }})()"
        )
        QTest.mouseClick(view.focusProxy(), Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, QPoint(round(x), round(y)))
        QTest.qWait(100)

    def key(selector: str, name: str) -> None:
        js(f"document.querySelector({json.dumps(selector)}).focus()")
        QTest.keyClick(view.focusProxy(), getattr(Qt.Key, f"Key_{name}"))
        QTest.qWait(100)

    def shot(path: str) -> bool:
        QTest.qWait(150)
        return view.grab().save(path)

    actions = {"open": load, "js": js, "click": click, "key": key, "shot": shot}
    results = [actions[name](*values) for name, *values in steps]
    print(json.dumps(results))
    sys.stdout.flush()
    os._exit(0)  # Qt complains where pages end after their profile; nothing is to be cleaned up


if __name__ == "__main__":
    sys.exit(_main(json.loads(sys.argv[1])))
