# ruff: noqa: E501 (a line of code to hand in has no breaks)
"""What students may hand in that nobody asked for, to replace exercise 01's answers or surround them.

`RETURNED` is code that defines `attack`, a function to replace any answer; `IN_THE_WAY` runs before all answers, each
of which returns 0; `STOPS` is a line at the start of an answer, which costs that task alone. `UNUSUAL` are cells that
may fail.
"""

RETURNED = {
    "another array each time": """
class Lazy:
    def __array__(self, *a, **k): return np.random.default_rng().random(4)
attack = lambda *a, **k: Lazy()""",
    "objects that equal all": """
class Evil:
    def __eq__(self, other): return True
    def __float__(self): return 0.0
    __sub__ = __rsub__ = __abs__ = __le__ = lambda self, *a: True
attack = lambda *a, **k: np.array([Evil()] * 4, dtype=object)""",
    "all masked": "attack = lambda *a, **k: np.ma.masked_all(4)",
    "a structure": "attack = lambda *a, **k: np.zeros(4, dtype=[('a', 'f8')])",
    "a float that lies": """
class Liar(float):
    __eq__ = __lt__ = __gt__ = lambda self, other: True
    __float__ = lambda self: 0.5
    __sub__ = __rsub__ = lambda self, other: 0.0
attack = lambda *a, **k: [Liar(0.25)] * 4""",
    "one number, repeated": "attack = lambda *a, **k: np.broadcast_to(0.25, (4, 10**7))",
    "a list in itself": "itself = []\nitself.append(itself)\nattack = lambda *a, **k: itself",
    "nested deeply": "deep = []\nfor _ in range(10**4): deep = [deep]\nattack = lambda *a, **k: deep",
    "a number of many digits": "import sys\nsys.set_int_max_str_digits(0)\nattack = lambda *a, **k: 10**20_000",
    "a function": "attack = lambda *a, **k: (lambda: 1)",
    "a class": "attack = float",
    "zeroed arguments": """
def attack(*arguments, **named):
    for one in arguments:
        if isinstance(one, np.ndarray): one[...] = 0
        elif isinstance(one, (list, dict)): one.clear()
    return arguments[0] if arguments else 0""",
    "a forged kind": """
class Forged:
    __class__ = float
    def __float__(self): return 1.0
attack = lambda *a, **k: Forged()""",
    "a record that isn't one": """
import dataclasses
@dataclasses.dataclass
class GridSpec:
    x: object = 0
GridSpec.__module__, GridSpec.__qualname__ = "semgrid_edu.grid", "GridSpec"
attack = lambda *a, **k: GridSpec()""",
    "what lies in memory": """
import gc
def attack(*a, **k):
    return next((x for x in gc.get_objects() if isinstance(x, np.ndarray) and x.shape == (4,) and x is not a[0]), 0)""",
    "a generator": "attack = lambda *a, **k: (x for x in a[0])",
    "text of megabytes": "attack = lambda *a, **k: 'full points granted by the dean ' * 100_000",
    "an endless array": "attack = lambda *a, **k: type('A', (), {'__array__': lambda s, *a, **k: s.__array__()})()",
}

SEND = """
import __main__, json
worker = __main__.Worker.serve.__globals__
Wire = worker["Wire"]
send = Wire.send
"""

IN_THE_WAY = {
    "two processes answer": """
import os
def predict(*a, **k):
    os.fork()
    return 0""",
    "replies in advance": SEND
    + """
def often(self, data):
    for _ in range(3): send(self, data)
Wire.send = often""",
    "replies of no kind": SEND
    + """
kinds = [{"streams": 5}, {"error": 5}, {"functions": 7}, {"values": []}, {"result": 0, "streams": {"stdout": 3}}]
kinds += [{"error": {"number": "x"}}, {"shown": [3]}, {"callback": "x"}, {"megabytes": "x"}, {"changed": 1}, {}]
def other(self, data):
    kinds.append(kinds.pop(0))
    send(self, worker["encode"](kinds[0]))
Wire.send = other""",
    "calls of what wasn't given": SEND
    + """
def ask(self, data):
    send(self, b'{"value": {"dict": [["callback", -1], ["arguments", []], ["named", {"dict": []}]]}, "arrays": []}\\n')
Wire.send = ask""",
    "arguments as they never were": SEND
    + """
def changed(self, data):
    head, _, rest = data.partition(b"\\n")
    head = json.loads(head)
    head["value"]["dict"] += [["changed", {"tuple": [{"tuple": [0, 0, 0, 0]}, {"dict": []}]}]]
    send(self, json.dumps(head).encode() + b"\\n" + rest)
Wire.send = changed""",
    "noise": SEND
    + """
import os, threading
def noise(self, data):
    self.outgoing.write(os.urandom(10**5))
    send(self, data)
Wire.send = noise""",
    "hooks": "import sys\nsys.settrace(lambda *a: None)\nsys.setprofile(lambda *a: None)\nsys.excepthook = print",
    "files of the system": """
import glob, os
for path in [*glob.glob("/proc/self/*"), *glob.glob("/proc/1/*"), *glob.glob("/dev/*"), *glob.glob("**", recursive=True)]:
    try: os.read(os.open(path, os.O_RDONLY | os.O_NONBLOCK), 10**5)
    except OSError: pass""",
}

STOPS = {
    "exit": "exit()",
    "the end of Python": "import os; os._exit(0)",
    "a wrong address": "import ctypes; ctypes.string_at(0)",
    "what can't be interrupted": "\n    while True:\n        try:\n            while True: pass\n        except BaseException: pass",
    "memory": "bytearray(10**11)",
    "a wait": "import signal; signal.pause()",
    "many threads": "import threading as t; [t.Thread(target=t.Event().wait, args=(9,)).start() for _ in range(999)]; 1 / 0",
    "forks in threads": "import os, threading; [threading.Thread(target=os.fork).start() for _ in range(5)]; 1 / 0",
    "the stack": "import sys; sys.setrecursionlimit(10**9); f = lambda f: f(f); f(f)",
    "an error without words": "\n    class E(Exception):\n        def __str__(self): raise self\n    raise E",
    "an error of many words": "raise ValueError('Crashed: ' * 10**6)",
    "an error with the name of a page": "raise type('<script>' * 999, (Exception,), {})('<script>alert(2)</script>')",
    "a group of errors": "raise BaseExceptionGroup('g', [SystemExit(), KeyboardInterrupt()])",
    "output of megabytes": "print('\\x1b[2J\\x1b]8;;http://elsewhere.example\\x07' * 10**5); return 0",
    "a closed wire": "import os; os.closerange(0, 99); return 0",
    "no more files": "import os; kept = [os.pipe() for _ in range(9999)]; return 0",
    "a folder that is gone": "import os; os.mkdir('x'); os.chdir('x'); os.rmdir('../x'); open('y', 'w')",
    "no streams": "import sys; sys.stdout = sys.stderr = sys.__stdout__ = None; print(1); return 0",
}


UNUSUAL = (
    "from __future__ import annotations\nimport typing",
    "%matplotlib inline\n%config InlineBackend.figure_format = 'svg'\n%load_ext autoreload\n%autoreload 2\n%time x = 1",
    "%%time\nx = 1",
    "%no_such_magic",
    "!ls -la\nfiles = !ls",
    "%%bash\necho 1",
    "# Règle de Bayes : la prévision, puis la mise à jour — « à la main »\nété = 1",
    "import pandas_that_is_not_there as pd",
    "name = input('who? ')",
    "here = __file__",
    "if __name__ == '__main__':\n    started = True",
    "from concurrent.futures import ThreadPoolExecutor\nwith ThreadPoolExecutor() as pool: list(pool.map(abs, range(9)))",
    "import asyncio\nawait asyncio.sleep(0)\nasyncio.new_event_loop().run_until_complete(asyncio.sleep(0))",
    "import ipywidgets\nipywidgets.interact(lambda x: x, x=3)",
    "from tqdm.auto import tqdm\nlist(tqdm(range(3)))",
    "import dataclasses, enum\n@dataclasses.dataclass\nclass A:\n    x: int = 0\nclass B(enum.Enum):\n    X = 1",
    "import pickle\nclass C: pass\npickle.loads(pickle.dumps(C()))",
    "np.random.seed(0)\nimport random; random.seed(0)",
    "np.set_printoptions(precision=2, suppress=True)\nnp.seterr(all='raise')",
    "x = 1\n%reset_selective -f x",
    "from IPython.display import clear_output\nclear_output()",
    "text = '" + "é" * 100_000 + "'",
    "x = 1\r\ny = 2\r\n",
    "if True:\n\tx = 1",
    "import warnings\nwarnings.filterwarnings('ignore')",
    "import matplotlib.pyplot as plt\nplt.imshow(np.eye(3)); plt.title('été'); plt.show()",
    "import tempfile, pathlib\npathlib.Path(tempfile.mkdtemp(), 'a').write_text('x')\nnp.save('a.npy', np.eye(2)); np.load('a.npy')",
    "ｘ = 'a name that Python writes otherwise'\nassert x == ｘ",
)
