"""A picture of a page that lives: picture.py URL FILE WIDTH HEIGHT [light|dark] [SECONDS]"""

import base64
import io
import json
import subprocess
import sys
import tempfile
import time

import websocket
from PIL import Image

url, file, width, height = sys.argv[1:5]
scheme = sys.argv[5] if len(sys.argv) > 5 else "light"
seconds = float(sys.argv[6]) if len(sys.argv) > 6 else 1.0
profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
browser = subprocess.Popen(
    ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--remote-debugging-port=0",
     f"--user-data-dir={profile.name}", f"--window-size={width},{height}", "about:blank"],
    stderr=subprocess.PIPE, text=True)
try:
    place = next(line.split()[-1] for line in browser.stderr if "DevTools listening on" in line)
    talk = websocket.create_connection(place, suppress_origin=True)
    number = 0

    def ask(method, session=None, **parameters):
        global number
        number += 1
        call = {"id": number, "method": method, "params": parameters}
        talk.send(json.dumps(call | ({"sessionId": session} if session else {})))
        while (answer := json.loads(talk.recv())).get("id") != number:
            pass
        return answer["result"]

    target = ask("Target.createTarget", url="about:blank")["targetId"]
    session = ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
    ask("Emulation.setDeviceMetricsOverride", session, width=int(width), height=int(height), deviceScaleFactor=1,
        mobile=int(width) < 500)
    ask("Emulation.setEmulatedMedia", session, features=[{"name": "prefers-color-scheme", "value": scheme}])
    ask("Page.navigate", session, url=url)
    time.sleep(seconds)
    data = base64.b64decode(ask("Page.captureScreenshot", session)["data"])
finally:
    browser.kill()
    browser.wait()
# 128 colours are enough for what has few, and a third of the size.
Image.open(io.BytesIO(data)).convert("RGB").quantize(128).save(file, optimize=True)
