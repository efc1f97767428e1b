# A python3 earlier on PATH (pyenv, conda) has no rospy and no catkin_pkg. ROS's own is Debian's.
foreach(variable PYTHON_EXECUTABLE Python3_EXECUTABLE)
  if(NOT ${variable} AND EXISTS /usr/bin/python3)
    set(${variable} /usr/bin/python3 CACHE FILEPATH "The Python that has ROS")
  endif()
endforeach()
