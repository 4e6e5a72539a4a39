"""Main functions of programs on stepped robots, in virtual time."""

from hero_node import Clock
from hero_node.parameters import check_parameters


class Run:
    """A main function with robots that begin at id 0, and an end of the program after some time of the robots.

    Attributes:
        asked: ids, odom and proximity of the robots that the program opened.
    """

    def __init__(self, monkeypatch, module, swarm, seconds=1e9, **given):
        self.module, self.asked = module, []
        run = self

        class Program(Clock):
            def __init__(self, name, anonymous=False):
                assert name == module.__name__.rpartition(".")[2]
                self._end_s = swarm.now_s + seconds

            def __enter__(self):
                return self

            def __exit__(self, *error):
                run.is_over = True

            @property
            def now_s(self):
                return swarm.now_s

            def sleep(self, duration_s):
                swarm.sleep(duration_s)
                return swarm.now_s < self._end_s

        def open_swarm(program, robot_ids, odom=True, proximity=True):
            self.asked.append((robot_ids, odom, proximity))
            return swarm

        monkeypatch.setattr(module, "Program", Program)
        monkeypatch.setattr(module, "open_swarm", open_swarm, raising=False)
        monkeypatch.setattr(module, "read_parameters", lambda declared: check_parameters(declared, given))

    def __call__(self):
        return self.module.main()
