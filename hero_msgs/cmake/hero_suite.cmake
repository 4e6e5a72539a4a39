# CMake functions for the packages of the suite. They are here because every package can find hero_msgs.

# hero_add_program(NAME [MODULE]): a program NAME for rosrun that calls main() of a module of the package (default: NAME).
# What main() returns is the exit status; an error of ours becomes one line: see hero_node.command_line.
# hero_add_node(NAME [MODULE]): one that takes ROS parameters only; --help prints the docstring of its module.
# hero_add_page_script(PAGE NAME [ARGUMENT ...]): one that runs a script of plain rospy, as students write it, which a page
# of a course holds; without arguments of its own the script is a node. --help prints its docstring.
#
# Its first line names the interpreter of the build, in the devel and the install space: catkin_install_python() would
# write "env python3" for the install space, and the first python3 on PATH (pyenv, conda) may have no rospy. A module that is
# not installed is named in one line. The rospy of Debian 11 calls Thread.isAlive(), which its Python 3.9 no longer has.
function(hero_add_program name)
  set(module ${name} ${ARGN})
  list(GET module -1 module)
  _hero_write_program(${name} "from hero_node.command_line import run
    from ${PROJECT_NAME}.${module} import main" "run(main)")
endfunction()

function(hero_add_node name)
  set(module ${name} ${ARGN})
  list(GET module -1 module)
  _hero_write_program(${name} "from hero_node.command_line import check_node_arguments, run
    from ${PROJECT_NAME}.${module} import main" "\
check_node_arguments('${PROJECT_NAME}', '${name}', sys.modules[main.__module__].__doc__)
run(main)")
endfunction()

function(hero_add_page_script page name)
  get_filename_component(page ${page} ABSOLUTE)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${page})
  file(READ ${page} text)
  set(head "scripts/${name} -->\n```python\n")
  string(FIND "${text}" "${head}" start)
  if(start EQUAL -1)
    message(FATAL_ERROR "${page} holds no script ${name}")
  endif()
  string(LENGTH "${head}" length)
  math(EXPR start "${start} + ${length}")
  string(SUBSTRING "${text}" ${start} -1 text)
  string(FIND "${text}" "```" length)
  string(SUBSTRING "${text}" 0 ${length} text)
  string(REPLACE ";" " " arguments "${ARGN}")
  set(file ${CATKIN_PACKAGE_BIN_DESTINATION}/scripts/${name})
  file(WRITE ${CATKIN_DEVEL_PREFIX}/${file} "${text}")
  install(FILES ${CATKIN_DEVEL_PREFIX}/${file} DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION}/scripts)
  _hero_write_program(${name} "import os
    from hero_node.ros.script import run_script" "\
file = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scripts', '${name}')
run_script('${PROJECT_NAME}', file, '${arguments}'.split())")
endfunction()

function(_hero_write_program name import call)
  set(program ${CMAKE_CURRENT_BINARY_DIR}/programs/${name})
  string(REPLACE "\n" "\n    " call "${call}")
  # Modules load for a second or more: Ctrl-C then ends the program at once, without a traceback. Processes that
  # multiprocessing spawns load the program, too, and must not start it.
  file(WRITE ${program} "#!${PYTHON_EXECUTABLE}
import signal
import sys
from threading import Thread

if not hasattr(Thread, 'isAlive'):
    Thread.isAlive = Thread.is_alive

handler = signal.signal(signal.SIGINT, signal.SIG_DFL)
try:
    ${import}
except ModuleNotFoundError as error:
    sys.exit('${name}: %s; script/bootstrap (or rosdep) installs what all programs need' % error)
signal.signal(signal.SIGINT, handler)
if __name__ == '__main__':
    ${call}
")
  install(PROGRAMS ${program} DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
  file(COPY ${program} DESTINATION ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION}
    FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
endfunction()

# hero_add_tests(): run_tests runs test/unit by pytest and every test/rostest/*.test, and checks the launch files.
function(hero_add_tests)
  if(IS_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/test/unit)
    set(results ${CATKIN_TEST_RESULTS_DIR}/${PROJECT_NAME}/pytest.xml)
    catkin_run_tests_target("pytest" "unit" "pytest.xml"
      COMMAND "${PYTHON_EXECUTABLE} -m pytest test/unit --junitxml=${results}"
      WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
  endif()
  if(IS_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/launch)
    find_package(roslaunch REQUIRED)
    roslaunch_add_file_check(launch)
  endif()
  file(GLOB rostests RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} test/rostest/*.test)
  if(rostests)
    find_package(rostest REQUIRED)
    foreach(rostest ${rostests})
      add_rostest(${rostest})
    endforeach()
  endif()
endfunction()
