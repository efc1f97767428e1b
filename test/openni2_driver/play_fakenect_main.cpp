// play_fakenect DIRECTORY COMMAND...: writes a dump and runs the command with fakenect playing it, for launch
// files.
#include <cstdlib>

#include "fakenect_dump.h"

int main(int argc, char** argv) {
  if (argc < 3) return 1;
  knav::fakenect::write_dump(argv[1], 1800);
  setenv("FAKENECT_PATH", argv[1], 1);
  const char* old = std::getenv("LD_LIBRARY_PATH");
  setenv("LD_LIBRARY_PATH",
         (std::string(KINECT_NAV_FAKENECT_FOLDER) + ":" + (old == nullptr ? "" : old)).c_str(), 1);
  execvp(argv[2], argv + 2);
  return 1;
}
