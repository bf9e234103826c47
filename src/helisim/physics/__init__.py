"""The force laws, compiled, and the callbacks that lend them to MuJoCo."""
