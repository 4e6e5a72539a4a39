# CMake functions for the packages of the suite. They are here because every package can find hero_msgs.

# hero_add_program(NAME [MODULE]): a program NAME for rosrun that calls main() of a module of the package (default: NAME).
# hero_add_node(NAME [MODULE]): one that takes ROS parameters only; --help prints the docstring of its module.
#
# Its first line names the interpreter of the build, in the devel and the install space: catkin_install_python() would
# write "env python3" for the install space, and the first python3 on PATH (pyenv, conda) may have no rospy. A module that is
# not installed is named in one line. The rospy of Debian 11 calls Thread.isAlive(), which its Python 3.9 no longer has.
function(hero_add_program name)
  _hero_write_program(${name} "" ${ARGN})
endfunction()

function(hero_add_node name)
  _hero_write_program(${name} "import argparse

argparse.ArgumentParser(
    prog='${name}',
    usage='rosrun ${PROJECT_NAME} ${name} [_PARAMETER:=VALUE ...] [TOPIC:=TOPIC ...]',
    description=sys.modules[main.__module__].__doc__,
    epilog='Parameters and topics: ${PROJECT_NAME}/README.md',
    formatter_class=argparse.RawDescriptionHelpFormatter,
).parse_args([word for word in sys.argv[1:] if ':=' not in word])
" ${ARGN})
endfunction()

function(_hero_write_program name check_arguments)
  set(module ${name})
  if(ARGC GREATER 2)
    set(module ${ARGV2})
  endif()
  set(program ${CMAKE_CURRENT_BINARY_DIR}/programs/${name})
  # Modules load for a second or more: Ctrl-C then ends the program at once, without a traceback.
  file(WRITE ${program} "#!${PYTHON_EXECUTABLE}
import signal
import sys
from threading import Thread

if not hasattr(Thread, 'isAlive'):
    Thread.isAlive = Thread.is_alive

handler = signal.signal(signal.SIGINT, signal.SIG_DFL)
try:
    from ${PROJECT_NAME}.${module} import main
except ModuleNotFoundError as error:
    sys.exit('${name}: %s; script/bootstrap (or rosdep) installs what all programs need' % error)

${check_arguments}
signal.signal(signal.SIGINT, handler)
sys.exit(main())
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
