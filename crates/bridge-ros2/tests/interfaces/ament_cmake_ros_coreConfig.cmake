# Kilted's generators ask for this package, which is in no wheel; of Jazzy's packages this one does the same.
find_package(ament_cmake_ros REQUIRED)
