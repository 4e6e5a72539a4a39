#!/usr/bin/env python3
"""What the page shows, in a real browser: charts, table, map, projector, and contrast by axe; without ROS."""

import math
import time
import unittest
from pathlib import Path

import rostest
from scripted_monitor import ScriptedMonitor, make_fleet, make_program, make_robot

from hero_test.screens.browser import MISSING
from hero_test.screens.monitor_page import MonitorPage
from hero_test.waiting import wait_for

AXE = (Path(__file__).resolve().parents[1] / "vendor" / "axe.min.js").read_text(encoding="utf-8")
RUN_AXE = """
const [only, done] = arguments;
axe.run(document, { runOnly: only }).then(({ violations }) =>
  done(violations.map(({ id, nodes }) => id + ": " + nodes.map((node) => node.html.slice(0, 90)).join(" | "))));
"""
KEEP_STEPS = """
const done = arguments[0];
import("/panels/chart.js").then(({ History }) => {
  const robot = { name: "hero_0", state: "READY", known: true, odom: 29, speed: 0.1, turn: 0, values: {} };
  const [history, state] = [new History(), { fleet: { robots: [robot] }, ranges: {} }];
  const now = Date.now;
  for (const ms of [100000, 100400, 100500, 104000, 107501]) {
    Date.now = () => ms;
    history.update(state);
  }
  Date.now = () => 108001;
  robot.known = false;
  history.update(state);
  Date.now = now;
  done(history.listSeries(["hero_0"], (one) => one.speed));
});
"""
READ_PIXELS = """
const canvas = document.getElementById("canvas"), ratio = devicePixelRatio;
const { width, height } = canvas.getBoundingClientRect();
const context = canvas.getContext("2d");
const read = (x, y) => [...context.getImageData(x * ratio, y * ratio, 1, 1).data].slice(0, 3);
return arguments[0].map(([right, up]) => read(width / 2 + right, height / 2 - up));
"""
FIND_CUT = """
const cut = (one) => one.clientWidth > 0 && one.scrollWidth > one.clientWidth + 1;
return [document.body, ...document.querySelectorAll("header, main section, .scroll, .filters, #tabs")]
  .filter(cut).map((one) => one.id + one.className + " " + one.scrollWidth + " > " + one.clientWidth);
"""
COUNT_WALL = """
const canvas = document.getElementById("canvas"), ratio = devicePixelRatio, frame = canvas.getBoundingClientRect();
const { left, top, right, bottom } = document.getElementById("invite").getBoundingClientRect();
const { data, width } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
const counts = { behind: 0, elsewhere: 0 };
for (let index = 0; index < data.length; index += 4) {
  if (data[index] !== 0x7b || data[index + 1] !== 0x86 || data[index + 2] !== 0x96) continue;
  const x = frame.left + ((index / 4) % width) / ratio, y = frame.top + Math.floor(index / 4 / width) / ratio;
  counts[x >= left && x <= right && y >= top && y <= bottom ? "behind" : "elsewhere"] += 1;
}
const { clientWidth, clientHeight } = document.getElementById("map");
const isDrawn = width === Math.round(clientWidth * ratio) && canvas.height === Math.round(clientHeight * ratio);
return isDrawn && right - left > 50 && counts.behind + counts.elsewhere > 100 ? counts : null;
"""
READ_COLORS = """
const tags = [...document.querySelectorAll("tbody [data-state]")];
return tags.map((tag) => getComputedStyle(tag).backgroundColor);
"""
ALL_RULES = ("wcag2a", "wcag2aa", "wcag21a", "wcag21aa")
COLORS_ALONE = ("color-contrast",)
BODY_MM = 36.85


@unittest.skipIf(MISSING, "not installed: %s (script/bootstrap --test)" % ", ".join(MISSING))
class ViewTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.monitor = ScriptedMonitor()
        cls.page = MonitorPage(cls.monitor.url)

    @classmethod
    def tearDownClass(cls):
        cls.page.close()
        cls.monitor.close()

    def setUp(self):
        self.show([make_robot(number) for number in range(4)])
        self.monitor.show(programs=[])
        self.monitor.requests.clear()
        self.page.open()
        self.page.wait_for_text("#ready", "4 of 4 robots ready")

    def tearDown(self):
        self.assertEqual(self.page.errors(), [])

    def show(self, robots, traveled_m=0.0, **fleet):
        poses = {
            robot["name"]: [300 * (index % 10) + round(1000 * traveled_m), 300 * (index // 10), 0]
            for index, robot in enumerate(robots)
        }
        ranges = {robot["name"]: [None, 120, 0, -1] for robot in robots}
        self.monitor.show(fleet=make_fleet(*robots, **fleet), poses=poses, ranges=ranges, losses=[], stop=None)

    def drive(self, robots, condition):
        """Let robots drive at 0.05 m/s until a condition is true."""
        start_s = time.monotonic()

        def is_true():
            self.show(robots, 0.05 * (time.monotonic() - start_s))
            return condition()

        wait_for(is_true, "the page to show it")

    def test_head_panel_and_table_tell_of_robots_in_the_same_words(self):
        robots = [make_robot(0), make_robot(1), make_robot(2, state="AWAY")]
        self.show(robots, stopped=True, counts="0 of 3 robots ready, 2 stopped, 1 lost")
        for text in ("#ready", "#state"):
            self.page.wait_for_text(text, "0 of 3 robots ready, 2 stopped, 1 lost")
        self.assertEqual([row["State"] for row in self.page.rows()], ["STOPPED", "STOPPED", "AWAY"])

    def test_robots_that_are_gone_are_named_until_a_user_dismisses_them(self):
        self.show([make_robot(0)])
        loss = {"source": "robots", "cause": "7 gone since 18:43", "remedy": "Switch them on, or dismiss this"}
        self.monitor.show(losses=[loss])
        self.page.wait_for_text("#losses", "7 gone since 18:43. Switch them on")
        self.assertEqual(self.page.text("#link"), "robots lost")
        self.page.click("#losses button")
        self.monitor.wait_for_request("dismiss")

    def test_speeds_are_in_the_table_and_their_mean_beside_the_chart(self):
        robots = [make_robot(number, speed=speed) for number, speed in enumerate((0.05, 0.10, 0.0, None))]
        self.drive(robots, lambda: self.page.text("#chart_now") == "now 0.05 m/s")
        self.assertEqual([row["Speed"] for row in self.page.rows()], ["0.05 m/s", "0.10 m/s", "0.00 m/s", "-"])

    def test_a_chart_shows_the_chosen_quantity_of_all_robots_or_one(self):
        self.drive([make_robot(number) for number in range(4)], lambda: "now" in self.page.text("#chart_now"))
        count = "return document.querySelectorAll('#chart canvas').length"
        self.assertEqual(self.page.run(count), 1)
        self.page.find("#quantity [value='nearest']").click()
        self.drive([make_robot(number) for number in range(4)], lambda: self.page.text("#chart_now") == "now 0.00 m")
        label = self.page.find("#chart").get_attribute("aria-label")
        self.assertEqual(label, "nearest obstacle over the last minute, m")
        self.page.choose("hero_1")
        self.assertEqual(self.page.run(count), 1)

    def test_a_line_of_a_chart_is_interrupted_where_nothing_was_known(self):
        times_s, speeds = self.page.browser.execute_async_script(KEEP_STEPS)
        self.assertEqual(times_s, [-8.001, -7.501, -4.001, -4.0, -0.5, 0])
        self.assertEqual(speeds, [0.1, 0.1, 0.1, None, 0.1, None])

    def test_the_table_hides_details_until_they_are_asked_for(self):
        def heads():
            found = self.page.browser.find_elements("css selector", "th[scope=col]")
            return [head.text.split()[0] for head in found if head.text]

        self.assertEqual(heads(), ["Robot", "State", "Light", "Nearest", "Speed", "Pose"])
        self.page.click("#details")
        self.assertIn("Versions", heads())
        self.page.click("#details")

    def test_only_what_is_wrong_has_color_in_the_table(self):
        self.show([make_robot(0), make_robot(1, state="AWAY"), make_robot(2, known=False), make_robot(3, odom=0.0)])
        wait_for(lambda: [row["State"] for row in self.page.rows()][3] == "READY, no data", self.page.rows)
        colors = self.page.run(READ_COLORS)
        self.assertEqual(colors[0], "rgba(0, 0, 0, 0)")
        self.assertEqual(len(set(colors)), 4)

    def test_the_light_of_a_robot_leaves_its_ring_of_identity_alone(self):
        self.monitor.show(fleet=make_fleet(make_robot(0)), poses={"hero_0": [0, 0, 0]}, ranges={}, lights={})
        self.page.wait_for_text("#ready", "1 of 1")
        self.page.click("#numbers")  # they are written over the light
        self.page.click("#fit")

        def read():
            # Fit shows 300 mm around a single robot. Middle, light, gap and ring, at an angle without the arrow.
            width, height = self.page.run("return [canvas.clientWidth, canvas.clientHeight - 72]")
            scale = min(width, height) * 0.95 / 300
            radii = [part * BODY_MM * scale for part in (0.0, 0.6, 0.755, 0.905)]
            points = [[radius * math.cos(2.2), radius * math.sin(2.2)] for radius in radii]
            return self.page.browser.execute_script(READ_PIXELS, points)

        def read_when(is_lit):
            pixels = read()
            return pixels if (pixels[0] == [0, 255, 0]) == is_lit else None

        # By its light it is known that the robot is drawn, and after Fit.
        self.monitor.show(lights={"hero_0": "#00ff00"})
        lit = wait_for(lambda: read_when(True), read)
        self.monitor.show(lights={})
        dark = wait_for(lambda: read_when(False), read)
        self.assertEqual(lit[1], [0, 255, 0])
        self.assertEqual(lit[2:], dark[2:])
        self.assertNotIn(lit[3], (lit[0], lit[2]))

    def test_the_projector_shows_the_map_alone_and_stop_all_in_its_place(self):
        place = self.page.find("#stop").rect
        self.page.click("#projector")
        wait_for(lambda: not self.page.find("#fleet").is_displayed(), "the map alone")
        width = self.page.run("return innerWidth")
        self.assertEqual(self.page.find("#map").rect["width"], width)
        self.page.save("monitor_projector.png")
        self.assertTrue(self.page.find("#stop").is_displayed())
        self.page.click("#projector")
        wait_for(lambda: self.page.find("#fleet").is_displayed(), "the whole page")
        self.assertEqual(self.page.find("#stop").rect, place)

    def test_an_empty_page_names_the_address_that_robots_connect_to(self):
        for listening, shown in (
            ("0.0.0.0:11411", "to this PC, port 11411"),
            ("10.42.0.1:11411", "to 10.42.0.1:11411"),
        ):
            self.show([], listening=listening)
            self.page.wait_for_text("#empty", shown)

    def test_no_wall_is_drawn_behind_the_class_code_of_the_projector(self):
        sides = ((0, 0, 0), (0, 1800, 0), (-900, 900, 1571), (900, 900, 1571))
        walls = [[*side, 1800, 20, None] for side in sides]
        lesson = {"code": "123456", "link": "http://lab:8088/", "qr": ["10" * 12] * 25, "drivers": [], "users": []}
        self.addCleanup(self.page.resize, 1440, 900)
        self.addCleanup(self.monitor.show, lesson=None, arena={"boxes": [], "circles": [], "extent": None})
        self.monitor.show(lesson=lesson, arena={"boxes": walls, "circles": [], "extent": [-900, 0, 900, 1800]})
        for size in ((768, 1024), (320, 640), (1280, 800)):
            self.page.resize(*size)
            self.page.run("document.getElementById('projector').click()")  # phones show the button on request
            found = wait_for(lambda: self.page.run(COUNT_WALL), size)
            self.assertEqual(found["behind"], 0, size)
            self.page.run("document.getElementById('projector').click()")

    def send_until(self, kind, act, program=None):
        """Act, again where a busy PC let the page take it for a late input; return the request, that for a program.

        What it took late it may send after all: a second request for the program before.
        """

        def find():
            return [request for request in self.monitor.requested(kind) if request.get("program") == program]

        def is_sent():
            if not find():
                act()
            return find()

        return wait_for(is_sent, "the request " + kind)[-1]

    def test_a_loop_shift_and_all_choose_robots_that_are_driven_and_stopped(self):
        from selenium.webdriver.common.keys import Keys

        def shown():
            return self.page.text("#name")

        canvas = self.page.find("#canvas")
        self.page.click("#fit")
        loop = self.page.actions().key_down(Keys.SHIFT).move_to_element_with_offset(canvas, -420, -90).click_and_hold()
        for place in ((420, -90), (420, 90), (-420, 90)):
            loop.move_to_element_with_offset(canvas, *place)
        loop.release().key_up(Keys.SHIFT).perform()
        wait_for(lambda: shown() == "4 robots", shown)
        wait_for(lambda: self.page.run(FIND_CUT) == [], lambda: self.page.run(FIND_CUT))
        row = self.page.find("#fleet tbody tr:nth-child(3) button")
        self.page.actions().key_down(Keys.SHIFT).click(row).key_up(Keys.SHIFT).perform()
        wait_for(lambda: shown() == "3 robots", shown)
        three = ["hero_0", "hero_1", "hero_3"]
        self.page.hold("forward", lambda: self.monitor.requested("drive"), "the request drive")
        self.page.actions().release().perform()
        self.assertEqual(self.monitor.requested("drive")[-1]["robots"], three)
        stop = self.send_until("stop_some", lambda: self.page.click("#stop_some"))
        self.assertEqual(stop["robots"], three)
        self.page.click("#all")
        wait_for(lambda: shown() == "4 robots", shown)

    def test_the_keyboard_chooses_robots_that_then_move_as_they_stand(self):
        from selenium.webdriver.common.keys import Keys

        self.page.find("#fleet tbody tr:nth-child(2) button").send_keys(Keys.SPACE)
        self.page.find("#select").send_keys(Keys.ENTER)
        self.page.find("#fleet tbody tr:nth-child(3) button").send_keys(Keys.SPACE)
        self.page.wait_for_text("#name", "2 robots")
        self.page.find("#fleet tbody tr:nth-child(4) button").send_keys(Keys.ENTER)
        self.page.wait_for_text("#name", "3 robots")
        self.page.click("#goto")
        self.page.find("#canvas").send_keys(Keys.ARROW_LEFT, Keys.ENTER)  # the middle of the view
        wait_for(lambda: len(self.monitor.requested("goal")) == 3, "a goal for each")
        goals = {request["robots"][0]: (request["x"], request["y"]) for request in self.monitor.requested("goal")}
        self.assertEqual(sorted(goals), ["hero_1", "hero_2", "hero_3"])
        for left, right in (("hero_1", "hero_2"), ("hero_2", "hero_3")):
            self.assertAlmostEqual(goals[right][0] - goals[left][0], 0.3)
            self.assertAlmostEqual(goals[right][1], goals[left][1])

    def test_a_program_starts_with_its_parameters_and_is_shown_until_it_ends(self):
        self.page.choose("hero_1")
        self.page.find("#program [value='random_walk']").click()
        self.page.run("document.querySelector('[name=linear_m_s]').value = 0.9")
        self.page.click("#start")  # refused by the page: beyond the limit
        self.page.run("document.querySelector('[name=linear_m_s]').value = 0.05")
        request = self.send_until("start", lambda: self.page.click("#start"), "random_walk")
        self.assertEqual(request["robots"], ["hero_1"])
        self.assertEqual(request["values"], {"linear_m_s": 0.05, "angular_rad_s": 1.5})
        self.monitor.requests.clear()
        self.page.find("#program [value='behavior_segregation']").click()
        self.page.run("document.querySelector('[name=groups]').value = 2.5")
        self.page.click("#start")  # refused by the page: no whole number
        self.page.run("document.querySelector('[name=groups]').value = 3")
        request = self.send_until("start", lambda: self.page.click("#start"), "behavior_segregation")
        self.assertEqual(request["values"]["groups"], 3)
        self.monitor.requests.clear()
        self.page.find("#program [value='swarm_go_to']").click()
        self.page.click("#start")
        request = self.send_until("start", lambda: self.page.click("#canvas"), "swarm_go_to")
        self.assertEqual((request["values"]["shape"], request["values"]["turn_deg"]), ("circle", 0))
        self.assertEqual(self.page.find("#hint").is_displayed(), False)
        self.monitor.show(programs=[make_program(7), make_program(8, program="record", bytes=2400000)])
        self.page.wait_for_text("#running", "random walk, 2 robots, 1:05")
        self.page.wait_for_text("#recorded", "1:05, 2.4 MB in /tmp/recordings")
        self.assertEqual(self.send_until("end", lambda: self.page.click("#running button"))["number"], 7)
        self.assertFalse(self.send_until("record", lambda: self.page.click("#record"))["on"])
        self.monitor.show(programs=[make_program(7, failure="no pose of hero_1")])
        self.page.wait_for_text("#running", "random walk failed: no pose of hero_1")
        self.assertFalse(self.page.find("#rec").is_displayed())
        self.page.wait_for_text("#recorded", "recorded 1:05, 2.4 MB in /tmp/recordings")

    def test_messages_that_differ_only_in_numbers_are_one_line(self):
        texts = ["hero_%d: silent for %d.5 s" % (number % 3, number) for number in range(6)]
        lines = [[number, 0.0, 4, "hero_driver", text[:6], text] for number, text in enumerate(texts)]
        lines += [[number, 0.0, 2, "hero_monitor", "", "Kim: drive hero_%d" % number] for number in (6, 7)]
        self.monitor.tell(log={"missed": 0, "lines": [*lines, [8, 0.0, 4, "other", "", "ends"]]})
        wait_for(lambda: self.page.text("#lines").endswith("ends"), "the lines")
        shown = self.page.run("return [...document.querySelectorAll('#lines li')].map((one) => one.innerText)")
        self.assertEqual(len(shown), 4, "a user drives two robots, which is told of each")
        for text in ("3 robots", "silent for 5.5 s", "6 times"):
            self.assertIn(text, shown[0])

    def test_a_phone_cuts_nothing_off_and_shows_layers_on_request(self):
        self.page.resize(320, 568)
        self.addCleanup(self.page.resize, 1440, 900)
        numbers = self.page.find("#numbers")
        self.assertFalse(numbers.is_displayed())
        self.page.click("#layers")
        self.assertTrue(numbers.is_displayed())
        self.page.click("#layers")
        self.page.save("monitor_phone.png")
        for panel in ("fleet", "robot", "log"):
            self.page.click("[data-panel=%s]" % panel)
            self.assertEqual(self.page.run(FIND_CUT), [], panel)
        self.page.click("[data-panel=fleet]")
        loss = {"source": "driver", "cause": "No answer from hero_driver", "remedy": "Start it again: " + 9 * "word "}
        status = {"level": "error", "text": "NOT STOPPED: hero_3 moves" + 20 * " word", "is_final": True, "reads": 0}
        self.show([make_robot(number, stop="MOVING", known=number > 0) for number in range(4)], stopped=True)
        self.monitor.show(losses=[loss], stop=status)
        for banner in ("#losses", "#stopping", "#release_bar"):
            wait_for(self.page.find(banner).is_displayed, banner)
        self.page.wait_for_text("#fleet tbody", "UNKNOWN")
        wait_for(lambda: self.page.run(FIND_CUT) == [], lambda: self.page.run(FIND_CUT))
        self.page.click("#fleet tbody tr:nth-child(2) button")  # scrolls, and fails unless it can be reached
        self.page.wait_for_text("#name", "hero_1")

    def test_a_phone_on_its_side_shows_map_and_table_side_by_side(self):
        self.addCleanup(self.page.resize, 1440, 900)
        for width, height in ((568, 320), (844, 390)):
            self.page.resize(width, height)
            least = height / 3
            wait_for(lambda least=least: self.page.find("#fleet .scroll").rect["height"] >= least, (width, height))
            for panel in ("fleet", "robot", "log"):
                self.page.click("[data-panel=%s]" % panel)
                self.assertEqual(self.page.run(FIND_CUT), [], panel)
            self.page.click("[data-panel=fleet]")

    def test_no_state_of_the_page_breaks_a_rule_of_wcag_aa(self):
        robots = [make_robot(number, stop="at rest") for number in range(3)]
        away = make_robot(3, state="AWAY", error="silent for 6.1 s")
        bad = [away, make_robot(4, known=False), make_robot(5, odom=0.0)]
        status = {"level": "error", "text": "NOT STOPPED: hero_3 moves", "is_final": False, "reads": 0}
        loss = {"source": "driver", "cause": "No answer from hero_driver", "remedy": "start it again"}

        def read_state():
            banners = [one for one in ("#losses", "#release_bar", "#stopping") if self.page.find(one).is_displayed()]
            return self.page.text("#ready"), banners

        def find_faults(only=ALL_RULES):
            return self.page.browser.execute_async_script(RUN_AXE, only)

        stopped = {
            "fleet": make_fleet(*robots, stopped=True, counts="0 of 3 robots ready"),
            "stop": {**status, "level": "info"},
        }
        disturbed = {
            "fleet": make_fleet(*robots, *bad, counts="1 of 6 robots unknown"),
            "stop": status,
            "losses": [loss],
        }
        self.page.run(AXE)
        self.addCleanup(self.page.browser.execute_cdp_cmd, "Emulation.setEmulatedMedia", {"features": []})
        for theme, only, updates, ready, shown in (
            ("light", ALL_RULES, {"fleet": make_fleet()}, "0 of 0 robots ready", []),
            ("light", ALL_RULES, stopped, "0 of 3 robots ready", ["#release_bar", "#stopping"]),
            ("light", ALL_RULES, disturbed, "1 of 6 robots unknown", ["#losses", "#stopping"]),
            ("dark", COLORS_ALONE, stopped, "0 of 3 robots ready", ["#release_bar", "#stopping"]),
            ("dark", COLORS_ALONE, disturbed, "1 of 6 robots unknown", ["#losses", "#stopping"]),
        ):
            media = {"features": [{"name": "prefers-color-scheme", "value": theme}]}
            self.page.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
            self.monitor.show(**{"stop": None, "losses": [], **updates})
            wait_for(lambda wanted=(ready, shown): read_state() == wanted, (ready, shown))
            self.assertEqual(find_faults(only), [], (theme, ready, shown))
        self.addCleanup(self.page.resize, 1440, 900)
        self.page.resize(360, 740)
        for panel in ("robot", "log"):
            self.page.click("[data-panel=%s]" % panel)
            self.assertEqual(find_faults(), [], panel)
        self.page.run("document.body.append(document.createElement('button'))")
        (broken,) = find_faults(("button-name",))
        self.assertTrue(broken.startswith("button-name: "), "a button without a name is found")


if __name__ == "__main__":
    rostest.rosrun("hero_monitor", "test_monitor_view", ViewTest)
