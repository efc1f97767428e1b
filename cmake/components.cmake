# The few shapes a target has here. ROS headers are SYSTEM, so that our warnings speak of our code only.

# kinect_nav_library(NAME SOURCES... LINK libs...): a component's ROS-free algorithm, libkinect_nav_NAME.so
function(kinect_nav_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_library(kinect_nav_${name} SHARED ${ARG_SOURCES})
  target_include_directories(kinect_nav_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CATKIN_PACKAGE_INCLUDE_DESTINATION}>)
  target_link_libraries(kinect_nav_${name} PUBLIC ${ARG_LINK} PRIVATE kinect_nav_warnings)
  kinect_nav_install_library(kinect_nav_${name})
endfunction()

# kinect_nav_ros(TARGET): lets a target include ROS and this package's messages
function(kinect_nav_ros target)
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_include_directories(${target} SYSTEM PRIVATE
    ${catkin_INCLUDE_DIRS} ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_INCLUDE_DESTINATION})
  target_link_libraries(${target} PUBLIC ${catkin_LIBRARIES} PRIVATE kinect_nav_warnings)
  add_dependencies(${target} ${PROJECT_NAME}_generate_messages_cpp ${PROJECT_NAME}_gencfg)
endfunction()

# kinect_nav_nodelets(COMPONENT SOURCES... LINK libs...): libkinect_nav_COMPONENT_nodelets.so, named in
# COMPONENT/nodelet_plugins.xml
function(kinect_nav_nodelets component)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  set(target kinect_nav_${component}_nodelets)
  add_library(${target} SHARED ${ARG_SOURCES})
  target_link_libraries(${target} PUBLIC kinect_nav_ros_common ${ARG_LINK})
  kinect_nav_ros(${target})
  kinect_nav_install_library(${target})
  install(FILES nodelet_plugins.xml DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION}/${component})
endfunction()

# kinect_nav_node(NAME CLASS): the nodelet kinect_nav/CLASS as a plain node of its own
function(kinect_nav_node name class)
  set(KINECT_NAV_NODELET_CLASS ${class})
  configure_file(${PROJECT_SOURCE_DIR}/ros_common/nodelet_main.cpp.in ${CMAKE_CURRENT_BINARY_DIR}/${name}_main.cpp @ONLY)
  add_executable(${name}_node ${CMAKE_CURRENT_BINARY_DIR}/${name}_main.cpp)
  kinect_nav_ros(${name}_node)
  kinect_nav_install_program(${name}_node)
endfunction()

# kinect_nav_program(NAME SOURCES... LINK libs...): a command line program; links CLI11, json and ros_common
function(kinect_nav_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE kinect_nav_ros_common CLI11::CLI11 nlohmann_json::nlohmann_json ${ARG_LINK})
  kinect_nav_ros(${name})
  kinect_nav_install_program(${name})
endfunction()

function(kinect_nav_install_library target)
  install(TARGETS ${target}
    LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION} RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION})
endfunction()

function(kinect_nav_install_program target)
  set_target_properties(${target} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_PACKAGE_BIN_DESTINATION})
  install(TARGETS ${target} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endfunction()

# kinect_nav_test(NAME SOURCES... LINK libs... [ROS]): a GoogleTest program; built by the target 'tests'
function(kinect_nav_test name)
  cmake_parse_arguments(ARG "ROS" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} EXCLUDE_FROM_ALL ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK} GTest::gtest GTest::gmock GTest::gtest_main kinect_nav_warnings)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(${name} PRIVATE KINECT_NAV_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  if(ARG_ROS)
    target_link_libraries(${name} PRIVATE kinect_nav_ros_common)
    kinect_nav_ros(${name})
  endif()
  add_dependencies(tests ${name})
  add_test(NAME ${name} COMMAND ${name})
  set_tests_properties(${name} PROPERTIES SKIP_REGULAR_EXPRESSION "KINECT_NAV_SKIP:")
endfunction()

# kinect_nav_benchmark(NAME SOURCES... LINK libs...): a Google Benchmark program, with -DKINECT_NAV_BENCHMARKS=ON
function(kinect_nav_benchmark name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  if(NOT KINECT_NAV_BENCHMARKS)
    return()
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK} benchmark::benchmark benchmark::benchmark_main kinect_nav_warnings)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(${name} PRIVATE KINECT_NAV_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
endfunction()
