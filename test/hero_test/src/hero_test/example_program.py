"""A node of hero_examples as a process of its own, as a user starts it."""

from hero_test.processes import Program, find_program


class ExampleProgram(Program):
    """Has a new node name, because private parameters outlive a node."""

    _count = 0

    def __init__(self, name, *arguments, environment=None):
        ExampleProgram._count += 1
        node = "__name:=%s_%d" % (name, ExampleProgram._count)
        super().__init__(find_program("hero_examples", name), node, *arguments, environment=environment)
