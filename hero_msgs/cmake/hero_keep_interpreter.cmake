# hero_keep_interpreter(NAME...): lets programs that catkin_install_python() installs run with the interpreter of the
# build in the install space too.
#
# catkin_install_python() writes "env python3" into them, and the first python3 on PATH (pyenv, conda) may have no
# rospy. This stands in hero_msgs because every other package of the suite can find hero_msgs.
function(hero_keep_interpreter)
  foreach(name ${ARGN})
    # What catkin_install_python() has prepared for the install space.
    set(program ${CMAKE_CURRENT_BINARY_DIR}/catkin_generated/installspace/${name})
    file(READ ${program} text)
    string(REGEX REPLACE "^#![^\n]*\n" "#!${PYTHON_EXECUTABLE}\n" text "${text}")
    file(WRITE ${program} "${text}")
  endforeach()
endfunction()
