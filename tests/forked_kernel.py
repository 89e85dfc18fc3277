"""Kernels for nbval that are forked from a process in which the large libraries and the package are loaded.

A kernel of its own loads them anew, for several seconds of a processor. ipywidgets isn't among them, because it looks
at the kernel when it is imported.
"""

import multiprocessing
import os
import signal
from importlib.metadata import EntryPoint

import matplotlib as mpl
from jupyter_client.provisioning import KernelProvisionerFactory, LocalProvisioner

LIBRARIES = ["ipykernel.kernelapp", "semgrid_edu.plotting", "semgrid_edu.networks", "semgrid_edu.crf"]
FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(LIBRARIES)


def run_kernel(arguments, folder, environment):
    """Be a kernel: what the forked process does."""
    # tqdm takes a process that has loaded this for a notebook, so the tests' own processes must not.
    from ipykernel.kernelapp import launch_new_instance

    os.setpgrp()  # what is sent to the group of a kernel doesn't reach the tests
    os.environ.update(environment, JPY_PARENT_PID=str(os.getppid()))  # it ends when the process that forked it has
    os.chdir(folder)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # as nbval has it
    mpl.rcParams["backend"] = "module://matplotlib_inline.backend_inline"  # a kernel says so by MPLBACKEND
    launch_new_instance(argv=arguments)


class Forked:
    """A process of `multiprocessing` with the methods of `subprocess.Popen` that jupyter_client calls."""

    stdin = stdout = stderr = None

    def __init__(self, process):
        self.process, self.pid = process, process.pid

    def poll(self):
        return self.process.exitcode

    def wait(self):
        self.process.join()
        return self.process.exitcode

    def send_signal(self, number):
        os.kill(self.pid, number)

    def kill(self):
        self.send_signal(signal.SIGKILL)

    def terminate(self):
        self.send_signal(signal.SIGTERM)


class ForkedProvisioner(LocalProvisioner):
    """Starts a kernel by a fork instead of a command."""

    async def launch_kernel(self, cmd, **options):
        arguments = cmd[cmd.index("-f") :]
        process = FORKS.Process(target=run_kernel, args=(arguments, str(options["cwd"]), dict(options["env"])))
        process.start()
        self.process, self.pid = Forked(process), process.pid
        return self.connection_info


def fork_kernels(wanted: bool) -> None:
    """Let the kernels of this process be forked from now on, or let each be started by its command."""
    factory = KernelProvisionerFactory.instance()
    factory.provisioners["forked"] = EntryPoint("forked", f"{__name__}:ForkedProvisioner", factory.GROUP_NAME)
    factory.default_provisioner_name = "forked" if wanted else "local-provisioner"
